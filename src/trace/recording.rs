//! Evidence for effects of the recording: miscounted fringe orders, found as regions, and the phase-shift error, found within blocks.

use super::tracing::Finding;
use crate::effect::{self, Effect};
use crate::error::Result;
use crate::field::Field;
use crate::identify::fringes::{self, order_mm};
use crate::identify::jumps::{self, Jumps};
use crate::infer::Model;
use crate::quantity::NM_PER_MM;

/// A phase-shift error is accepted above this log Bayes factor, the prototype study's: no field without an error reaches it, and an
/// amplitude of 3 nm in 10 nm of noise does (`tests/unit/phase.rs`).
const PHASE_LOG_BAYES_FACTOR: f64 = 4.0;

/// Whether an effect of the recording may be sought: not declared, not ruled out by the model's candidates.
fn sought(model: &Model, name: &str) -> bool {
    let declared = model.effects.iter().any(|e| e.name() == name);
    let listed = |list: &Vec<String>| list.iter().any(|n| n == name);
    !declared && model.experiment().candidates.as_ref().is_none_or(listed)
}

/// Jumps of a field relative to a prediction, and what they are called; the field is returned corrected.
///
/// # Errors
/// Of the program, if the dictionary lacks the effect.
pub fn find_jumps(
    model: &Model,
    field: &Field,
    predicted: &[[f64; 2]],
) -> Result<(Option<Field>, Option<Finding>)> {
    let effect = effect::of_recording(effect::RecordingError::MiscountedOrders);
    let Some(order_mm) = order_mm(model).filter(|_| sought(model, effect.name())) else {
        return Ok((None, None));
    };
    let jumps = jumps::find(field, predicted, order_mm);
    if jumps.regions.is_empty() {
        return Ok((None, None));
    }
    let found = jump_found(effect, &jumps, field, model);
    let mut corrected = field.clone();
    jumps.correct(&mut corrected);
    Ok((Some(corrected), Some(found)))
}

/// Whether a field may have jumps relative to a prediction: some are found, or it is too steep for a search.
pub fn may_jump(model: &Model, field: &Field, predicted: &[[f64; 2]]) -> bool {
    order_mm(model).is_some_and(|order_mm| {
        let found = jumps::find(field, predicted, order_mm);
        found.refused.is_some() || !found.regions.is_empty()
    })
}

/// The largest region speaks for the effect; its evidence is that of a step of whole orders at every point of a region's border,
/// which no noise of a few nanometres makes.
fn jump_found(effect: &'static dyn Effect, jumps: &Jumps, field: &Field, model: &Model) -> Finding {
    let region = &jumps.regions[0];
    let in_data = field.frame.vector(match region.component {
        0 => [f64::from(region.orders), 0.0],
        _ => [0.0, f64::from(region.orders)],
    });
    let centre = field.frame.data_point(region.centre_mm);
    let radius =
        0.5 * (region.high_mm[0] - region.low_mm[0]).max(region.high_mm[1] - region.low_mm[1]);
    let values = [in_data[0], in_data[1], centre[0], centre[1], radius];
    let noise = crate::noise::white(field).sd_mm[region.component].max(f64::MIN_POSITIVE);
    let points: usize = jumps.regions.iter().map(|r| r.points).sum();
    let log_bayes_factor = 0.5 * points as f64 * (jumps.order_mm / noise).powi(2);
    let smallest = jumps.order_mm
        * model
            .experiment()
            .measurement
            .fringe_frequency_per_mm
            .unwrap_or(1.0);
    Finding {
        effect,
        law: None,
        inclusion_probability: 1.0,
        log_bayes_factor: log_bayes_factor.min(1e9),
        amplitude: effect
            .parameters()
            .iter()
            .zip(values)
            .map(|(p, v)| (effect::amplitude_name(effect, p), v, 0.0))
            .collect(),
        multiple: 1.0,
        explained_fraction: 1.0,
        detectable: smallest,
        aliases: Vec::new(),
    }
}

/// The phase-shift error of a field that is otherwise predicted, with whether it is to be accepted.
///
/// # Errors
/// Of the program, if the dictionary lacks the effect.
pub fn find_phase(
    model: &Model,
    field: &Field,
    predicted: &[[f64; 2]],
) -> Result<Option<(Finding, bool)>> {
    let effect = effect::of_recording(effect::RecordingError::PhaseRipple);
    let Some(order_mm) = order_mm(model).filter(|_| sought(model, effect.name())) else {
        return Ok(None);
    };
    let phase = fringes::find_phase(model, effect, field, predicted, order_mm);
    let prior_sd = fringes::phase_prior_sd_nm(model, effect);
    let log_bayes_factor = phase.log_bayes_factor();
    // even odds would ignore that there are two dozen effects
    let odds = (log_bayes_factor - (effect::EFFECTS.len() as f64).ln()).exp();
    let amplitude = phase.amplitudes_nm();
    let found = Finding {
        effect,
        law: None,
        inclusion_probability: if odds.is_finite() {
            odds / (1.0 + odds)
        } else {
            1.0
        },
        log_bayes_factor,
        amplitude: effect
            .parameters()
            .iter()
            .zip(amplitude)
            .map(|(p, (m, s))| (effect::amplitude_name(effect, p), m, s))
            .collect(),
        multiple: (0..4).fold(0.0_f64, |a, k| {
            a.max(amplitude[k].0.abs() / prior_sd[k / 2][k % 2])
        }),
        explained_fraction: explained(field, predicted, amplitude.map(|(mean, _)| mean)),
        detectable: phase.both.sd_nm[0] * (2.0 * (PHASE_LOG_BAYES_FACTOR + 6.0)).sqrt(),
        aliases: Vec::new(),
    };
    Ok(Some((found, log_bayes_factor > PHASE_LOG_BAYES_FACTOR)))
}

/// Share of the mean square misfit (translation aside) that a ripple of these amplitudes makes.
fn explained(field: &Field, predicted: &[[f64; 2]], amplitude_nm: [f64; 4]) -> f64 {
    let n = field.len().max(1) as f64;
    let misfit: f64 = field
        .displacement
        .iter()
        .zip(predicted)
        .map(|(u, p)| (u[0] - p[0]).powi(2) + (u[1] - p[1]).powi(2))
        .sum::<f64>()
        / n;
    let ripple = 0.5 * amplitude_nm.iter().map(|a| a * a).sum::<f64>();
    (ripple / (NM_PER_MM * NM_PER_MM) / misfit.max(f64::MIN_POSITIVE)).min(1.0)
}
