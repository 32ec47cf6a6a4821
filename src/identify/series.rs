//! The one field of a load series that is identified: what grows with the load, and in it what declared effects of the picture and of the
//! specimen's motion do.

use crate::error::Result;
use crate::experiment::{Experiment, State};
use crate::infer::{Column, Model, Observation, Stepped, SteppedColumn, Steps};

/// Replace the observation's displacement by what grows with the load over its steps, linear in the declared effects' amplitudes about
/// what tracing found of them, and give it their columns.
///
/// # Errors
/// Those of a finite-element solution.
pub fn combine(
    model: &Model,
    observation: &mut Observation,
    experiment: &dyn Experiment,
    about: State,
) -> Result<()> {
    let Some(steps) = &observation.steps else {
        return Ok(());
    };
    let points = &observation.field.points;
    let mut combined = steps.combined(points);
    let mut columns = Vec::new();
    let declared = model.stepped();
    if !declared.is_empty() {
        let ones = vec![1; points.len()];
        let stepped = Stepped {
            model,
            experiment,
            sight: &observation.sight,
            steps,
            places: points,
            counts: &ones,
            average: &|u| u.to_vec(),
            step: &|| (),
        };
        let at = model.traced.clone().unwrap_or_else(|| stepped.start(about));
        let here = stepped.here(&at)?;
        let (with, without) = (here.predicted(), here.plain());
        let mut remainder = sum(steps, points.len(), |c, k| with[c][k] - without[c][k]);
        for acts in &declared {
            for column in here.columns(acts)? {
                let field = of_column(steps, points.len(), &column);
                let amplitude = column.at - column.mean;
                for (left, u) in remainder.iter_mut().zip(&field) {
                    *left = [0, 1].map(|c| left[c] - amplitude * u[c]);
                }
                columns.push(SteppedColumn {
                    name: column.name,
                    prior_sd: column.sd,
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
    Ok(())
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
