//! What a replicate of a calibration of the loop is made of: a draw from all priors, and its measurement on a finer mesh.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::calibration::{NOISE_NM, constants};
use super::replicates::ReplicatePlan;
use crate::effect::{Acting, amplitude_name, force_scale};
use crate::error::Result;
use crate::experiment::Gauge;
use crate::experiment::series::Moving;
use crate::experiment::simulate::Truth;
use crate::experiment::simulate::series::SeriesTruth;
use crate::field::{READERS, Source};
use crate::infer::{EffectUnderLaw, Model, simulated_field, simulated_series};
use crate::linearise::{acting_in, candidates};
use crate::parameter::Parameter;
use crate::trace::SIZES;

/// The true noise sd of a point of image correlation is drawn from this interval, evenly in its logarithm, nm.
const IMAGES_NM: [f64; 2] = [50.0, 500.0];

/// Sd of the specimen's translation in every step of a series, mm.
const MOTION_MM: f64 = 0.2;

/// Between which the noise of a model's points is drawn, nm.
pub fn noise_nm(model: &Model) -> [f64; 2] {
    let images = model.experiment().measurement.image_correlation;
    images.map_or(NOISE_NM, |_| IMAGES_NM)
}

/// How many effects act, and how strongly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Acts {
    /// As many as the loop expects, with amplitudes from their priors.
    Expected,
    /// The same, but one at least.
    AtLeastOne,
    /// Any number up to this one, equally often, each amplitude of one to two plausible sizes.
    UpTo(usize),
}

/// A draw from the priors.
pub struct Drawn {
    /// All but what is another from step to step.
    pub truth: Truth,
    /// What moves the specimen or changes the force, with the stated amplitude.
    moving: Vec<(EffectUnderLaw, Vec<f64>)>,
    /// True force of every step of a series over the nominal one, with the error that it has of its own.
    loads: Option<Vec<f64>>,
    pub acted: Vec<EffectUnderLaw>,
}

impl Drawn {
    /// By the seed of the replicate and of the attempt.
    pub fn new(
        model: &Model,
        plan: &ReplicatePlan,
        acts: Acts,
        replicate: usize,
        attempt: u64,
    ) -> Self {
        let mut rng = Pcg64Dxsm::seed_from_u64(plan.seed_of(replicate, 4 + attempt));
        let constants = constants(model, &mut rng);
        let acted = acted(model, acts, &mut rng);
        let size = match acts {
            Acts::UpTo(_) => AmplitudeSize::Plain,
            Acts::Expected | Acts::AtLeastOne => AmplitudeSize::Prior,
        };
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
            let amplitude = amplitude(model, acts, size, &mut rng);
            if acts.varies() {
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
            amplitude: amplitude(model, &load, AmplitudeSize::Prior, &mut rng),
        });
        // the load scale has its own draw above
        let thickness = model.experiment().specimen.thickness_mm;
        let z: f64 = StandardNormal.sample(&mut rng);
        let [low, high] = noise_nm(model);
        truth.thickness_mm = thickness.mean + thickness.sd * z;
        truth.noise_nm = low * (high / low).powf(rng.random());
        truth.seed = rng.random();
        let share = 0.01 * model.experiment().forces().sd_percent;
        let mut in_error = |f: f64| {
            let z: f64 = StandardNormal.sample(&mut rng);
            f * (1.0 + share * z)
        };
        let loads = loads(model).map(|all| all.into_iter().map(&mut in_error).collect());
        Self {
            truth,
            moving,
            loads,
            acted,
        }
    }

    /// True constants.
    pub fn constants(&self) -> &[f64] {
        &self.truth.constants
    }

    /// Amplitudes of what acts in the model, as the loop weighs them.
    pub fn amplitude(&self, acts: &EffectUnderLaw) -> &[f64] {
        let moving = self.moving.iter().find(|(m, _)| m.is(acts)).map(|(_, a)| a);
        let fixed = || {
            self.truth
                .effects
                .iter()
                .find(|a| a.effect.name() == acts.effect.name())
        };
        moving
            .or_else(|| fixed().map(|a| &a.amplitude))
            .map_or(&[], Vec::as_slice)
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
            let law = acts.law.map(|law| law.key());
            for (p, x) in acts.effect.parameters().iter().zip(amplitude) {
                let amplitude = Parameter::amplitude(acts.effect.name(), p.name).under(law.clone());
                known.push((amplitude.name(), *x));
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
        if let (Some(loads), Some(declared)) = (&self.loads, loads(model)) {
            let simulated = simulated_series(model, &self.series(model, loads, &declared))?;
            let experiment = measured.experiment_mut();
            // no point of a specimen that moves stands still
            experiment.gauge = Gauge::Window;
            let steps = experiment.steps.iter_mut().flatten();
            for ((k, step), grid) in steps.enumerate().zip(&simulated.grids) {
                step.file = place.join(format!("step-{k:02}"));
                reader.write(&step.file, grid, frame)?;
            }
        } else {
            reader.write(&place, &simulated_field(model, &self.truth)?, frame)?;
            source.path = Some(place);
        }
        measured.experiment_mut().measurement.source = source;
        Ok(measured)
    }

    fn series(&self, model: &Model, loads: &[f64], declared: &[f64]) -> SeriesTruth {
        let largest = declared.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let relative: Vec<f64> = declared.iter().map(|f| f / largest).collect();
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
            loads: loads.to_vec(),
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

/// Effects that act, each by one law.
fn acted(model: &Model, acts: Acts, rng: &mut Pcg64Dxsm) -> Vec<EffectUnderLaw> {
    let (effects, _) = candidates(model);
    let mut open: Vec<EffectUnderLaw> = match loads(model) {
        Some(loads) => acting_in(&effects, &loads),
        None => EffectUnderLaw::without_laws(&effects),
    };
    let mut left: f64 = rng.random();
    let expected = SIZES.iter().take_while(|p| {
        left -= *p;
        left > 0.0
    });
    let expected = expected.count();
    let number = match acts {
        Acts::Expected => expected,
        Acts::AtLeastOne => expected.max(1),
        Acts::UpTo(most) => rng.random_range(0..=most),
    };
    let mut acted: Vec<EffectUnderLaw> = Vec::new();
    while acted.len() < number && !open.is_empty() {
        let one = open.swap_remove(rng.random_range(0..open.len()));
        open.retain(|other| other.effect.name() != one.effect.name());
        acted.push(one);
    }
    acted
}

/// How large an amplitude is drawn.
#[derive(Clone, Copy)]
enum AmplitudeSize {
    /// From the prior with which the loop weighs it.
    Prior,
    /// One to two sds of that prior, of either sign.
    Plain,
}

/// Amplitudes of an effect.
fn amplitude(
    model: &Model,
    acts: &EffectUnderLaw,
    size: AmplitudeSize,
    rng: &mut Pcg64Dxsm,
) -> Vec<f64> {
    let is_series = model.experiment().steps.is_some();
    let parameters = acts.effect.parameters().iter().enumerate();
    let one = |(k, p): (usize, &crate::effect::EffectParameter)| {
        let sd = if is_series {
            model.prior_sd_in_series(&model.scene(), acts.effect, k)
        } else {
            model.prior_sd(acts.effect, k).unwrap_or(0.0)
        };
        let z: f64 = StandardNormal.sample(rng);
        let z = match size {
            AmplitudeSize::Prior => z,
            AmplitudeSize::Plain => rng.random_range(1.0..2.0_f64).copysign(z),
        };
        let z = if p.positive { z.abs() } else { z };
        (sd * z).clamp(-p.bound, p.bound)
    };
    parameters.map(one).collect()
}
