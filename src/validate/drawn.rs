//! What a replicate of a calibration of the loop is made of: a draw from all priors, and its measurement on a finer mesh.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::calibration::{NOISE_NM, Plan};
use crate::effect::{Acting, amplitude_name, force_scale};
use crate::error::Result;
use crate::experiment::Gauge;
use crate::experiment::series::Moving;
use crate::experiment::simulate::Truth;
use crate::experiment::simulate::series::SeriesTruth;
use crate::field::{READERS, Source};
use crate::infer::{EffectUnderLaw, Model};
use crate::trace::{SIZES, acting_in, candidates};

/// The true noise sd of a point of image correlation is drawn from this interval, evenly in its logarithm, nm.
const IMAGES_NM: [f64; 2] = [50.0, 500.0];

/// Sd of the specimen's translation in every step of a series, mm.
const MOTION_MM: f64 = 0.2;

/// Between which the noise of a model's points is drawn, nm.
pub fn noise_nm(model: &Model) -> [f64; 2] {
    let images = model.experiment().measurement.image_correlation;
    images.map_or(NOISE_NM, |_| IMAGES_NM)
}

/// A draw from the priors.
pub struct Drawn {
    /// All but what moves the specimen from step to step.
    truth: Truth,
    /// What moves it, with the stated amplitude.
    moving: Vec<(EffectUnderLaw, Vec<f64>)>,
    pub acted: Vec<EffectUnderLaw>,
}

impl Drawn {
    /// By the seed of the replicate and of the attempt; with an effect at least if one is to be `withheld`.
    pub fn new(model: &Model, plan: &Plan, withheld: bool, replicate: usize, attempt: u64) -> Self {
        let mut rng = Pcg64Dxsm::seed_from_u64(plan.seed_of(replicate, 4 + attempt));
        let constants = constants(model, &mut rng);
        let acted = acted(model, withheld, &mut rng);
        let mut truth = Truth {
            constants,
            thickness_mm: 0.0,
            effects: Vec::new(),
            noise_nm: 0.0,
            correlation_mm: plan.correlation_mm,
            grid: plan.grid,
            seed: 0,
        };
        let mut moving = Vec::new();
        for acts in &acted {
            let amplitude = amplitude(model, acts, &mut rng);
            if acts.law.is_some() {
                moving.push((*acts, amplitude));
            } else {
                let effect = acts.effect;
                truth.effects.push(Acting { effect, amplitude });
            }
        }
        let load = EffectUnderLaw {
            effect: force_scale(),
            law: None,
        };
        truth.effects.push(Acting {
            effect: force_scale(),
            amplitude: amplitude(model, &load, &mut rng),
        });
        // the load scale has its own draw above
        let thickness = model.experiment().specimen.thickness_mm;
        let z: f64 = StandardNormal.sample(&mut rng);
        let [low, high] = noise_nm(model);
        truth.thickness_mm = thickness.mean + thickness.sd * z;
        truth.noise_nm = low * (high / low).powf(rng.random());
        truth.seed = rng.random();
        Self {
            truth,
            moving,
            acted,
        }
    }

    /// True constants.
    pub fn constants(&self) -> &[f64] {
        &self.truth.constants
    }

    /// What is true, by the names of the quoted draws: the constants first.
    pub fn truths(&self, model: &Model) -> Vec<(String, f64)> {
        let constants = model.constants().iter().map(|n| (*n).to_string());
        let mut known: Vec<(String, f64)> = constants
            .zip(self.truth.constants.iter().copied())
            .collect();
        for acting in &self.truth.effects {
            for (p, x) in acting.effect.parameters().iter().zip(&acting.amplitude) {
                known.push((amplitude_name(acting.effect, p), *x));
            }
        }
        for (acts, amplitude) in &self.moving {
            let law = acts
                .law
                .map_or(String::new(), |law| format!("@{}", law.key()));
            for (p, x) in acts.effect.parameters().iter().zip(amplitude) {
                known.push((format!("{}{law}", amplitude_name(acts.effect, p)), *x));
            }
        }
        known
    }

    /// The measurement, written at `place`, and the model of it.
    ///
    /// # Errors
    /// Effects that cannot act together; a place that cannot be written.
    pub fn simulated(&self, model: &Model, place: &Path) -> Result<Model> {
        let place = std::path::absolute(place).unwrap_or_else(|_| place.to_path_buf());
        let (reader, frame) = (READERS[0], model.scene().frame);
        let mut measured = model.clone();
        let mut source = Source {
            reader,
            path: None,
            columns: None,
        };
        if let Some(loads) = loads(model) {
            let simulated = model.simulate_series(&self.series(model, loads))?;
            let experiment = measured.experiment_mut();
            // no point of a specimen that moves stands still
            experiment.gauge = Gauge::Window;
            let steps = experiment.steps.iter_mut().flatten();
            for ((k, step), grid) in steps.enumerate().zip(&simulated.grids) {
                step.file = place.join(format!("step-{k:02}"));
                reader.write(&step.file, grid, frame)?;
            }
        } else {
            reader.write(&place, &model.simulate(&self.truth)?, frame)?;
            source.path = Some(place);
        }
        measured.experiment_mut().measurement.source = source;
        Ok(measured)
    }

    fn series(&self, model: &Model, loads: Vec<f64>) -> SeriesTruth {
        let largest = loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let relative: Vec<f64> = loads.iter().map(|f| f / largest).collect();
        let moving = self.moving.iter().flat_map(|(acts, amplitude)| {
            let of = |weights| Moving {
                effect: acts.effect,
                weights,
                amplitude: amplitude.clone(),
            };
            acts.weights(&relative).into_iter().map(of)
        });
        SeriesTruth {
            shared: self.truth.clone(),
            moving: moving.collect(),
            loads,
            motion_mm: MOTION_MM,
            subsets: model.subsets(),
        }
    }
}

/// Forces of the steps over the nominal one, of a series.
fn loads(model: &Model) -> Option<Vec<f64>> {
    let steps = model.experiment().steps.as_ref()?;
    let nominal = model.experiment().nominal_load().force_n;
    let of = |s: &crate::field::StepSpec| s.force_n.unwrap_or(0.0) / nominal;
    Some(steps.iter().map(of).collect())
}

/// Admissible constants.
fn constants(model: &Model, rng: &mut Pcg64Dxsm) -> Vec<f64> {
    let marginals = model.marginals();
    loop {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let x: Vec<f64> = marginals.iter().map(|m| m.mean + m.sd * normal()).collect();
        let inside = marginals.iter().zip(&x).all(|(m, x)| {
            let [low, high] = m.bounds();
            (low..=high).contains(x)
        });
        if inside && model.material().ply(&x).is_admissible() {
            return x;
        }
    }
}

/// As many effects as the loop expects, each by one law.
fn acted(model: &Model, withheld: bool, rng: &mut Pcg64Dxsm) -> Vec<EffectUnderLaw> {
    let (effects, _) = candidates(model);
    let mut open: Vec<EffectUnderLaw> = match loads(model) {
        Some(loads) => acting_in(&effects, &loads),
        None => EffectUnderLaw::without_laws(&effects),
    };
    let mut left: f64 = rng.random();
    let number = SIZES.iter().take_while(|p| {
        left -= *p;
        left > 0.0
    });
    let number = number.count().max(usize::from(withheld));
    let mut acted: Vec<EffectUnderLaw> = Vec::new();
    while acted.len() < number && !open.is_empty() {
        let one = open.swap_remove(rng.random_range(0..open.len()));
        open.retain(|other| other.effect.name() != one.effect.name());
        acted.push(one);
    }
    acted
}

/// An amplitude from the prior with which the loop weighs it.
fn amplitude(model: &Model, acts: &EffectUnderLaw, rng: &mut Pcg64Dxsm) -> Vec<f64> {
    let is_series = model.experiment().steps.is_some();
    let parameters = acts.effect.parameters().iter().enumerate();
    let one = |(k, p): (usize, &crate::effect::Parameter)| {
        let sd = if is_series {
            model.prior_sd_in_series(acts.effect, k)
        } else {
            model.prior_sd(acts.effect, k).unwrap_or(0.0)
        };
        let z: f64 = StandardNormal.sample(rng);
        let z = if p.positive { z.abs() } else { z };
        (sd * z).clamp(-p.bound, p.bound)
    };
    parameters.map(one).collect()
}

#[cfg(test)]
#[path = "../../tests/unit/drawn.rs"]
mod tests;
