//! Effects of the recording of fringes, miscounted orders and the phase-shift error: taken out of an observation where a model
//! declares them.
//!
//! A ripple at twice the fringe frequency averages to nothing over a block, so that block averages know nothing of it; and
//! differences of neighbouring pixels would take it for noise. It is therefore taken out before the noise is estimated.

use super::reduction::ReductionInput;
use super::{jumps, phase};
use crate::effect::{Effect, RecordingError, amplitude_name, of_recording, recorded_column};
use crate::error::Result;
use crate::experiment::predict;
use crate::field::{Blocks, Field};
use crate::infer::{Model, Observation, RecordedAmplitude};
use crate::noise::residual_of_fit;
use crate::quantity::NM_PER_MM;

/// The observation with its miscounted orders corrected, if the model declares them: regions of whole orders relative to the prediction
/// at the nominal point.
pub fn without_jumps(
    with: &ReductionInput<'_>,
    mut observation: Observation,
) -> Result<Observation> {
    let declared = declared(with.model, RecordingError::MiscountedOrders);
    let Some((order_mm, _)) = order_mm(with.model).zip(declared) else {
        return Ok(observation);
    };
    let predicted = predict(with.experiment, &with.nominal, &observation.sight)?.field;
    let jumps = jumps::find(&observation.field, &predicted, order_mm);
    jumps.correct(&mut observation.field);
    let smeared = |i: usize| jumps.smeared.binary_search(&i).is_ok();
    observation.drop_outliers(|i| !smeared(i));
    Ok(observation)
}

/// The observation with its phase-shift error estimated and subtracted, if the model declares it. The argument of the ripple is the
/// least-squares fit of the modes and any affine displacement, with a plane a block through what that leaves.
pub fn without_phase_error(
    with: &ReductionInput<'_>,
    mut observation: Observation,
) -> Result<Observation> {
    let model = with.model;
    let Some((order_mm, effect)) =
        order_mm(model).zip(declared(model, RecordingError::PhaseRipple))
    else {
        return Ok(observation);
    };
    let modes = with.modes(&observation)?;
    let left = residual_of_fit(&observation.field, &modes);
    let measured = &observation.field.displacement;
    let fitted: Vec<[f64; 2]> = measured
        .iter()
        .zip(&left)
        .map(|(u, r)| [u[0] - r[0], u[1] - r[1]])
        .collect();
    let found = find_phase(model, effect, &observation.field, &fitted, order_mm);
    let amplitude = found.amplitudes_nm();
    let scene = with.experiment.scene();
    for (k, (mean, _)) in amplitude.into_iter().enumerate() {
        let field = &mut observation.field;
        let column = recorded_column(effect, k, scene, &field.points, &found.smooth);
        for (u, c) in field.displacement.iter_mut().zip(&column) {
            *u = [u[0] - mean * c[0], u[1] - mean * c[1]];
        }
    }
    let parameters = effect.parameters().iter().zip(amplitude);
    observation.recorded = parameters
        .map(|(parameter, (mean, sd))| RecordedAmplitude {
            name: amplitude_name(effect, parameter),
            mean,
            sd,
        })
        .collect();
    Ok(observation)
}

/// The phase-shift error of a field that a prediction describes otherwise, with the model's prior of its amplitudes.
pub fn find_phase(
    model: &Model,
    effect: &dyn Effect,
    field: &Field,
    predicted: &[[f64; 2]],
    order_mm: f64,
) -> phase::PhaseError {
    let blocks = Blocks::new(field, Blocks::size_for(field), |_| true);
    let prior_sd = phase_prior_sd_nm(model, effect);
    phase::find(field, &blocks, predicted, order_mm, prior_sd)
}

/// Prior sd of the sine's and the cosine's amplitude, nm, for (u1, u2).
pub fn phase_prior_sd_nm(model: &Model, effect: &dyn Effect) -> [[f64; 2]; 2] {
    let bound = |k: usize| effect.parameters().get(k).map_or(NM_PER_MM, |p| p.bound);
    let prior_sd = |k: usize| model.prior_sd(effect, k).unwrap_or_else(|| bound(k));
    [0, 1].map(|c| [prior_sd(2 * c), prior_sd(2 * c + 1)])
}

fn declared(model: &Model, error: RecordingError) -> Option<&'static dyn Effect> {
    let name = of_recording(error).name();
    model.effects.iter().find(|e| e.name() == name).copied()
}

/// One fringe order, mm, where displacements are read from fringes.
pub fn order_mm(model: &Model) -> Option<f64> {
    let frequency = model.experiment().measurement.fringe_frequency_per_mm;
    frequency.map(|f| 1.0 / f)
}
