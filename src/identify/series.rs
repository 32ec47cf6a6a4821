//! The one field of a load series that is identified: what grows with the load, and in it what declared effects do.

use nalgebra::DVector;

use super::reduction::With;
use crate::effect::Scope;
use crate::error::Result;
use crate::infer::{Observation, SteppedColumn, Steps};
use crate::laminate::MeanSd;
use crate::linearise::{AtPlaces, Column, Forward};

/// The observation with its displacement replaced by what grows with the load over its steps, linear in the declared effects' amplitudes about
/// what tracing found of them, and with their columns.
///
/// # Errors
/// Those of a finite-element solution.
pub fn combined(with: &With<'_>, mut observation: Observation) -> Result<Observation> {
    let Some(steps) = &observation.steps else {
        return Ok(observation);
    };
    let (model, experiment) = (with.model, with.experiment);
    let points = &observation.field.points;
    let mut combined = steps.combined(points);
    let mut columns = Vec::new();
    let declared = model.stepped();
    if !declared.is_empty() {
        let ones = vec![1; points.len()];
        let forward = Forward {
            model,
            observing: Box::new(AtPlaces {
                experiment,
                sight: &observation.sight,
                steps,
                places: points,
                counts: &ones,
                blocks: None,
            }),
            step: &|| (),
        };
        let traced = with.traced;
        let at = traced.map_or_else(
            || forward.beginning(model.state(&|_| None)),
            |t| t.state.clone(),
        );
        let here = forward.about(&at)?;
        let (with, without) = (here.predicted()?, here.without(&declared)?);
        let mut remainder = sum(steps, points.len(), |c, k| with[c][k] - without[c][k]);
        for effect in &declared {
            for column in here.columns(effect)? {
                let field = of_column(steps, points.len(), &column);
                // amplitudes count from 0 in the fit, wherever their priors lie
                for (left, u) in remainder.iter_mut().zip(&field) {
                    *left = [0, 1].map(|c| left[c] - column.at * u[c]);
                }
                let known = traced.and_then(|t| t.amplitudes.iter().find(|a| a.0 == column.name));
                let prior = MeanSd {
                    mean: column.mean,
                    sd: column.sd,
                };
                // of the load's errors one field tells nothing: they are a common factor of all moduli
                let unseen = match effect.effect.scope() {
                    Scope::Force => 1.0,
                    _ => 1.0 - seen(steps, points.len(), &column),
                };
                columns.push(SteppedColumn {
                    prior: known.map_or(prior, |(_, all)| beside(prior, *all, unseen)),
                    name: column.name,
                    field,
                });
            }
        }
        for (u, left) in combined.iter_mut().zip(&remainder) {
            *u = [0, 1].map(|c| u[c] - left[c]);
        }
    }
    observation.field.displacement = combined;
    observation.stepped = columns;
    Ok(observation)
}

/// The share of what all steps see of a column that the combined field sees.
fn seen(steps: &Steps, points: usize, column: &Column) -> f64 {
    let weights: f64 = steps.weights().iter().map(|w| w * w).sum();
    let combined = sum(steps, points, |c, k| column.values[c][k]);
    let combined: f64 = combined.iter().flatten().map(|u| u * u).sum();
    let all: f64 = column.values.iter().map(DVector::norm_squared).sum();
    (combined / (weights * all).max(f64::MIN_POSITIVE)).min(1.0)
}

/// What is known of an amplitude beside the combined field: its `prior`, and of what `all` steps say the share that the field does not see.
fn beside(prior: MeanSd, all: MeanSd, unseen: f64) -> MeanSd {
    let [own, of_all] = [prior, all].map(|m| 1.0 / (m.sd * m.sd));
    let said = (of_all - own).max(0.0);
    if said <= 0.0 {
        return prior;
    }
    // the mean of what the steps say without the prior
    let mean = (all.mean * of_all - prior.mean * own) / said;
    let precision = own + unseen * said;
    MeanSd {
        mean: (own * prior.mean + unseen * said * mean) / precision,
        sd: precision.sqrt().recip(),
    }
}

/// The field of one border unit of a parameter, mm.
fn of_column(steps: &Steps, points: usize, column: &Column) -> Vec<[f64; 2]> {
    sum(steps, points, |c, k| column.values[c][k] / column.sd)
}

/// The weighted sum over the steps of stacked values of both components.
fn sum(steps: &Steps, points: usize, value: impl Fn(usize, usize) -> f64) -> Vec<[f64; 2]> {
    let weights = steps.weights();
    let at = |k: usize| {
        [0, 1].map(|c| {
            let own = weights.iter().enumerate();
            own.map(|(s, w)| w * value(c, s * points + k)).sum()
        })
    };
    (0..points).map(at).collect()
}
