//! The point about which tracing linearises: a ridge estimate of the constants with every effect present under its prior.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::sensitivities::{Candidate, Column, Linearised, Measured, Sensitivities};
use crate::effect::{Effect, Kind};
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{Softening, State};
use crate::infer::{Acts, Stepped};
use crate::noise::NormalEquations;

/// Parameters that move by less, prior sds, have converged: a shift that no decision depends on (prototype study).
pub const CONVERGED: f64 = 0.05;

/// Steps of the Gauss-Newton iteration.
pub const STEPS: usize = 4;

/// Constants stay within so many prior sds of their prior means, and above this share of them: what is beyond is no ply's.
const FARTHEST: f64 = 4.0;
const SMALLEST: f64 = 0.2;

/// Move the constants and declared amplitudes to where the data want them with every effect present under its prior, and return the
/// sensitivities there. A fit without the effects runs to absurd constants when a weakly observable one acts: with a hole 5 % larger
/// than declared its mode lies at E2 = 0.008 GPa (measured on the program as built).
pub fn at_ridge(
    linearised: &Linearised<'_>,
    measured: &Measured,
    state: &mut State,
    effects: &[&'static dyn Effect],
) -> Result<Sensitivities> {
    let mut sensitivities = linearised.sensitivities(state, effects)?;
    for _ in 0..STEPS {
        let moved = ridge_step(linearised, measured, state, &sensitivities);
        if moved < CONVERGED {
            break;
        }
        sensitivities = linearised.again(state, &sensitivities)?;
    }
    Ok(sensitivities)
}

/// One step to the ridge estimate under noise that is white on blocks; how far it goes, in prior sds.
fn ridge_step(
    linearised: &Linearised<'_>,
    measured: &Measured,
    state: &mut State,
    sensitivities: &Sensitivities,
) -> f64 {
    let solution = sensitivities.ridge(measured);
    let mut moved = constants_moved(state, sensitivities, &solution);
    for effect in &linearised.model.effects {
        let mut amplitude = state.amplitude(*effect);
        for (value, parameter) in amplitude.iter_mut().zip(effect.parameters()) {
            let name = crate::effect::amplitude_name(*effect, parameter);
            let Some(k) = sensitivities.base.iter().position(|c| c.name == name) else {
                continue;
            };
            let column = &sensitivities.base[k];
            let wanted = column.mean + column.sd * solution[k];
            if effect.kind() != Kind::Additive {
                moved = moved.max((wanted - *value).abs() / column.sd);
            }
            *value = wanted.clamp(-0.9 * parameter.bound, 0.9 * parameter.bound);
        }
        state.set(*effect, amplitude);
    }
    moved
}

/// The same of a series.
///
/// # Errors
/// Those of finite-element solutions.
pub fn series_at_ridge(
    stepped: &Stepped<'_>,
    measured: &Measured,
    state: &mut SeriesState,
    declared: &[Acts],
    candidates: &[Acts],
) -> Result<Sensitivities> {
    let mut sensitivities = of_series(stepped, state, declared, candidates)?;
    for _ in 0..STEPS {
        let solution = sensitivities.ridge(measured);
        let wanted = |k: usize| {
            let column: &Column = &sensitivities.base[k];
            column.mean + column.sd * solution[k]
        };
        let mut moved = constants_moved(&mut state.shared, &sensitivities, &solution);
        for acts in declared {
            for amplitude in acts.amplitudes(&state.loads, &stepped.steps.names) {
                let mut base = sensitivities.base.iter();
                let Some(at) = base.position(|c| c.name == amplitude.name) else {
                    continue;
                };
                let column = &sensitivities.base[at];
                let k = amplitude.parameter;
                let reach = 0.9 * acts.effect.parameters()[k].bound;
                let by = wanted(at).clamp(-reach, reach) - column.at;
                *state = state.raised(acts.effect, k, by, &amplitude.weights);
                moved = moved.max((by / column.sd).abs());
            }
        }
        if moved < CONVERGED {
            break;
        }
        let kept = sensitivities;
        sensitivities = of_series(stepped, state, declared, &[])?;
        sensitivities.candidates = kept.candidates;
        sensitivities.near_edge = kept.near_edge;
        let sought: Vec<Column> = sensitivities
            .candidates
            .iter()
            .flat_map(|c| c.columns.clone())
            .collect();
        sensitivities.carry(&sought);
    }
    Ok(sensitivities)
}

/// Linearise a series at a state.
pub fn of_series(
    stepped: &Stepped<'_>,
    at: &SeriesState,
    declared: &[Acts],
    candidates: &[Acts],
) -> Result<Sensitivities> {
    let here = stepped.here(at)?;
    let columns = |acts: &Acts| {
        let columns = here.columns(acts);
        (stepped.step)();
        columns
    };
    let mut base = here.always()?;
    let own: Vec<Vec<Column>> = declared.par_iter().map(columns).collect::<Result<_>>()?;
    base.extend(own.into_iter().flatten());
    let sought: Vec<Vec<Column>> = candidates.par_iter().map(columns).collect::<Result<_>>()?;
    let found = candidates.iter().zip(sought);
    let near_edge = if candidates.is_empty() {
        Vec::new()
    } else {
        here.softened(Softening::NearEdge)?
    };
    let mut sensitivities = Sensitivities {
        predicted: here.predicted(),
        base,
        constants: at.shared.constants.len(),
        candidates: found
            .map(|(acts, columns)| Candidate {
                effect: acts.effect,
                law: acts.law,
                columns,
            })
            .collect(),
        near_edge,
        known: stepped.model.known.clone(),
    };
    sensitivities.carry_to_means();
    Ok(sensitivities)
}

/// Move the constants of a state to where a solution wants them, in short steps; how far, in prior sds.
fn constants_moved(
    state: &mut State,
    sensitivities: &Sensitivities,
    solution: &DVector<f64>,
) -> f64 {
    let mut moved = 0.0_f64;
    for (k, value) in state.constants.iter_mut().enumerate() {
        let column = &sensitivities.base[k];
        // a prior sd a step keeps the constants admissible and the linearisation valid
        let wanted = column.mean + column.sd * solution[k];
        let step = (wanted - *value).clamp(-column.sd, column.sd);
        let reach = FARTHEST * column.sd;
        let low = (column.mean - reach).max(SMALLEST * column.mean);
        *value = (*value + step).clamp(low, column.mean + reach);
        moved = moved.max(step.abs() / column.sd);
    }
    moved
}

impl Sensitivities {
    /// Mean of all parameters, in prior sds from their means, with every candidate present at its prior and noise that
    /// is white, of the size that is left.
    fn ridge(&self, measured: &Measured) -> DVector<f64> {
        let worth = &measured.blocks.worth;
        let residual = measured.residual(self);
        let columns: Vec<&Column> = self
            .base
            .iter()
            .chain(self.candidates.iter().flat_map(|c| &c.columns))
            .collect();
        let p = columns.len();
        let mut gram = DMatrix::zeros(p, p);
        let mut right = DVector::zeros(p);
        let mut total = 0.0;
        for (c, residual) in residual.iter().enumerate() {
            let mut weighted = DMatrix::zeros(residual.len(), p + 1);
            for (b, &n) in worth.iter().cycle().take(residual.len()).enumerate() {
                let root = n.sqrt();
                for (k, column) in columns.iter().enumerate() {
                    weighted[(b, k)] = root * column.values[c][b];
                }
                weighted[(b, p)] = root * residual[b];
            }
            let all = weighted.tr_mul(&weighted);
            gram += all.view((0, 0), (p, p));
            right += all.view((0, p), (p, 1)).column(0);
            total += all[(p, p)];
        }
        let solve = |variance: f64| {
            let (mut gram, mut right) = (&gram / variance, &right / variance);
            self.add_known(&mut gram, &mut right);
            NormalEquations::with_unit_prior(gram, right)
                .map_or_else(|| DVector::zeros(p), |f| f.mean())
        };
        // the white variance of a point from what a nearly free fit leaves
        let nearly_free = solve(1e-12 * total.max(f64::MIN_POSITIVE));
        let left = total - 2.0 * right.dot(&nearly_free) + nearly_free.dot(&(&gram * &nearly_free));
        let freedom = (2 * residual[0].len()).saturating_sub(p).max(1) as f64;
        solve((left / freedom).max(1e-12 * total))
    }
}
