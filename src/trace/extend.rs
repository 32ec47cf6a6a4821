//! A model with one more declared effect.

use super::averaged::Interval;
use super::axis::entail_strain;
use super::tracing::Accepted;
use crate::effect::{Effect, amplitude_name};
use crate::files::Keyed;
use crate::infer::{Model, prior_box};

/// Half-width of the box of an added effect's amplitude: this many of its standard deviations, and this share of its prior's.
pub const BOX_SDS: f64 = 8.0;
const BOX_SHARE: f64 = 0.1;

/// The model with one more declared effect, and with what that entails. The DoE box lies about the amplitude's estimate and the averaged
/// posterior, whose means are the nominal constants: bending solved at prior means, one prior sd off, was found 6 % too large.
pub fn extended(model: &Model, accepted: &Accepted, averaged: &Keyed<Interval>) -> Model {
    let Accepted {
        effect,
        amplitude,
        law,
        plausible,
    } = accepted;
    let effect = *effect;
    let mut model = model.clone();
    narrow(&mut model, averaged);
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
    if model.sampled().iter().any(|e| e.name() == effect.name()) {
        let prior_sd: Vec<f64> = effect
            .parameters()
            .iter()
            .enumerate()
            .map(|(k, p)| model.prior_sd(effect, k).unwrap_or(p.bound))
            .collect();
        let doe = model.file.reduced_model.doe.get_or_insert_default();
        let values = amplitude.iter().zip(prior_sd);
        for (parameter, ((mean, sd), prior_sd)) in effect.parameters().iter().zip(values) {
            let half = (BOX_SDS * sd)
                .max(BOX_SHARE * prior_sd)
                .min(3.0 * prior_sd.max(mean.abs()));
            let reach = parameter.bound;
            doe.insert(
                amplitude_name(effect, parameter),
                [(mean - half).max(-reach), (mean + half).min(reach)],
            );
        }
        model.ask_for_snapshots();
    }
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

/// Half-width of the constants' box about the averaged posterior: this many of its sds, and this share of the value at least.
const CONSTANT_SDS: f64 = 8.0;
const CONSTANT_SHARE: f64 = 0.05;

/// Draw the DoE box in about the constants' averaged posterior, within the priors' box.
fn narrow(model: &mut Model, averaged: &Keyed<Interval>) {
    let widest = prior_box(model);
    let doe = model.file.reduced_model.doe.get_or_insert_default();
    for ((name, constant), widest) in averaged.iter().zip(widest) {
        let half = (CONSTANT_SDS * constant.sd).max(CONSTANT_SHARE * constant.mean.abs());
        let side = [
            (constant.mean - half).max(widest.low),
            (constant.mean + half).min(widest.high),
        ];
        if side[0] < side[1] {
            doe.insert(name.clone(), side);
        }
    }
}
