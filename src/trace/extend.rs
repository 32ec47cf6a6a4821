//! A model with one more declared effect.

use super::averaged::Interval;
use super::axis::entail_strain;
use super::tracing::Accepted;
use crate::effect::Effect;
use crate::files::Keyed;
use crate::infer::Model;

/// The model with one more declared effect, and with what that entails. The averaged posterior's means are the nominal constants: bending solved
/// at prior means, one prior sd off, was found 6 % too large.
pub fn extended(model: &Model, accepted: &Accepted, averaged: &Keyed<Interval>) -> Model {
    let Accepted {
        effect,
        amplitude,
        law,
        plausible,
    } = accepted;
    let effect = *effect;
    let mut model = model.clone();
    model.nominal = Some(averaged.iter().map(|(_, constant)| constant.mean).collect());
    take_effective_subset(&mut model, effect, amplitude);
    model
        .experiment_mut()
        .effects
        .push(effect.name().to_string());
    model.effects = crate::effect::EFFECTS
        .iter()
        .filter(|e| {
            model
                .experiment()
                .effects
                .iter()
                .any(|name| name == e.name())
        })
        .copied()
        .collect();
    if model.experiment().steps.is_none() {
        entail_strain(&mut model, effect, amplitude);
    }
    let experiment = model.experiment_mut();
    experiment.plausible.extend(plausible.iter().cloned());
    let law = law.map(|law| (effect.name().to_string(), law));
    experiment.laws.extend(law);
    model
}

/// Where the fields were found to be smoothed as by a larger subset than declared, the next model averages over that one. Points go whose
/// subset then reaches over an edge, because it is not known how a correlation fits the rest of a subset.
fn take_effective_subset(model: &mut Model, effect: &'static dyn Effect, amplitude: &[(f64, f64)]) {
    let means: Vec<f64> = amplitude.iter().map(|a| a.0).collect();
    let larger = effect.smoothing(&means, 1);
    let images = &mut model.experiment_mut().measurement.image_correlation;
    if let Some(images) = images.as_mut().filter(|_| larger > 0.0) {
        images.effective_subset_mm = Some(images.subset_mm * (1.0 + larger));
    }
}
