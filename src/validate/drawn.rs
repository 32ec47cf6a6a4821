//! What a replicate of a calibration is made of: a draw from all priors, and its measurement on a finer mesh.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::plan::CalibrationPlan;
use crate::effect::{Acting, Effect, Kind, force_scale};
use crate::error::Result;
use crate::experiment::Gauge;
use crate::experiment::series::Moving;
use crate::experiment::simulate::Truth;
use crate::experiment::simulate::series::SeriesTruth;
use crate::field::{READERS, Source};
use crate::infer::{EffectUnderLaw, Model, simulated_field, simulated_series};
use crate::linearise::{acting_in, candidates};
use crate::parameter::{NOISE, Parameter};
use crate::trace::SIZES;

/// The true noise sd of a point is drawn from one of these intervals, evenly in its logarithm, nm: of moire, and of image correlation.
const MOIRE_NM: [f64; 2] = [3.0, 30.0];
const IMAGES_NM: [f64; 2] = [50.0, 500.0];

/// Sd of the specimen's translation in every step of a series, mm.
const MOTION_MM: f64 = 0.2;

/// Between which the noise of a model's points is drawn, nm.
pub fn noise_nm(model: &Model) -> [f64; 2] {
    let images = model.experiment().measurement.image_correlation;
    images.map_or(MOIRE_NM, |_| IMAGES_NM)
}

/// A draw from the priors.
pub struct Drawn {
    /// All but what is another from step to step.
    pub truth: Truth,
    /// Amplitudes of all that acts: what the model does not declare, what it declares, the scale of the force.
    amplitudes: Vec<(EffectUnderLaw, Vec<f64>)>,
    /// True force of every step of a series over the nominal one, with the error that it has of its own.
    loads: Option<Vec<f64>>,
    /// Effects that act and that the model does not declare.
    pub acted: Vec<EffectUnderLaw>,
}

impl Drawn {
    /// By the seed of the replicate and of the attempt.
    pub fn new(model: &Model, plan: &CalibrationPlan, replicate: usize, attempt: u64) -> Self {
        let mut rng = Pcg64Dxsm::seed_from_u64(plan.seed_of(replicate, 4 + attempt));
        let constants = constants(model, &mut rng);
        let acted = acted(model, plan, &mut rng);
        let scale = EffectUnderLaw {
            effect: force_scale(),
            law: None,
        };
        let mut amplitudes = Vec::new();
        for acts in &acted {
            let size = match plan.effects {
                Some(_) => AmplitudeSize::Plain,
                None => AmplitudeSize::Prior,
            };
            amplitudes.push((*acts, amplitude(model, acts, size, &mut rng)));
        }
        for acts in declared(model).into_iter().chain([scale]) {
            let amplitude = amplitude(model, &acts, AmplitudeSize::Prior, &mut rng);
            amplitudes.push((acts, amplitude));
        }
        let fixed = amplitudes.iter().filter(|(acts, _)| !acts.varies());
        let fixed = fixed.map(|(acts, amplitude)| Acting {
            effect: acts.effect,
            amplitude: amplitude.clone(),
        });
        // the load scale has its own draw above
        let thickness = model.experiment().specimen.thickness_mm;
        let z: f64 = StandardNormal.sample(&mut rng);
        let [low, high] = noise_nm(model);
        let truth = Truth {
            constants,
            thickness_mm: thickness.mean + thickness.sd * z,
            effects: fixed.collect(),
            noise_nm: low * (high / low).powf(rng.random()),
            correlation_mm: plan.correlation_mm,
            grid: plan.grid,
            seed: rng.random(),
        };
        let share = 0.01 * model.experiment().forces().sd_percent;
        let mut in_error = |f: f64| {
            let z: f64 = StandardNormal.sample(&mut rng);
            f * (1.0 + share * z)
        };
        let loads = loads(model).map(|all| all.into_iter().map(&mut in_error).collect());
        Self {
            truth,
            amplitudes,
            loads,
            acted,
        }
    }

    /// Amplitudes of what acts, as the loop weighs them.
    pub fn amplitude(&self, acts: &EffectUnderLaw) -> &[f64] {
        let own = self.amplitudes.iter().find(|(other, _)| other.is(acts));
        own.map_or(&[], |(_, amplitude)| amplitude)
    }

    /// What is true, by the names of the draws.
    pub fn truths(&self, model: &Model) -> Vec<(String, f64)> {
        let constants = model.constants().iter().map(|n| (*n).to_string());
        let mut known: Vec<(String, f64)> = constants
            .zip(self.truth.constants.iter().copied())
            .collect();
        known.push((NOISE.into(), self.truth.noise_nm));
        for (acts, amplitude) in &self.amplitudes {
            // a declared effect has one law, which its amplitude does not name
            let is_declared = !self.acted.iter().any(|other| other.is(acts));
            let law = acts.law.filter(|_| !is_declared).map(|law| law.key());
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
        let (Some(loads), Some(declared)) = (&self.loads, loads(model)) else {
            return simulated_at(model, &self.truth, place);
        };
        let place = std::path::absolute(place).unwrap_or_else(|_| place.to_path_buf());
        let simulated = simulated_series(model, &self.series(model, loads, &declared))?;
        let mut measured = model.clone();
        let experiment = measured.experiment_mut();
        experiment.measurement.source = source();
        // no point of a specimen that moves stands still
        experiment.gauge = Gauge::Window;
        let steps = experiment.steps.iter_mut().flatten();
        for ((k, step), grid) in steps.enumerate().zip(&simulated.grids) {
            step.file = place.join(format!("step-{k:02}"));
            READERS[0].write(&step.file, grid, model.scene().frame)?;
        }
        Ok(measured)
    }

    fn series(&self, model: &Model, loads: &[f64], declared: &[f64]) -> SeriesTruth {
        let largest = declared.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let relative: Vec<f64> = declared.iter().map(|f| f / largest).collect();
        let moving = self.amplitudes.iter().filter(|(acts, _)| acts.varies());
        let moving = moving.flat_map(|(acts, amplitude)| {
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

/// A single field with a known truth, written at `place`, and the model of it.
///
/// # Errors
/// A truth that cannot be; a place that cannot be written.
pub fn simulated_at(model: &Model, truth: &Truth, place: &Path) -> Result<Model> {
    let place = std::path::absolute(place).unwrap_or_else(|_| place.to_path_buf());
    let grid = simulated_field(model, truth)?;
    READERS[0].write(&place, &grid, model.scene().frame)?;
    let mut measured = model.clone();
    let measurement = &mut measured.experiment_mut().measurement;
    measurement.source = source();
    measurement.source.path = Some(place);
    Ok(measured)
}

/// Files as the simulation writes them.
fn source() -> Source {
    Source {
        reader: READERS[0],
        path: None,
        columns: None,
    }
}

/// Constants from their priors, that a ply can have.
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

/// Forces of the steps over the nominal one, of a series.
fn loads(model: &Model) -> Option<Vec<f64>> {
    let steps = model.experiment().steps.as_ref()?;
    let nominal = model.experiment().nominal_load().force_n;
    let of = |s: &crate::field::StepSpec| s.force_n.unwrap_or(0.0) / nominal;
    Some(steps.iter().map(of).collect())
}

/// Declared effects, each by its law. Rigid motions have flat priors, of which any draw is as good as any other, and what is in the recording
/// is estimated before.
fn declared(model: &Model) -> Vec<EffectUnderLaw> {
    let drawn = model
        .effects
        .iter()
        .filter(|e| !e.is_rigid() && !e.is_of_every_test() && e.kind() != Kind::Recorded);
    let is_series = model.experiment().steps.is_some();
    let under_law = |&effect: &&'static dyn Effect| match is_series {
        true => model.under_law(effect),
        false => EffectUnderLaw { effect, law: None },
    };
    drawn.map(under_law).collect()
}

/// Effects that act and are not declared, each by one law: none if the model alone is calibrated.
fn acted(model: &Model, plan: &CalibrationPlan, rng: &mut Pcg64Dxsm) -> Vec<EffectUnderLaw> {
    if !plan.closes_loop {
        return Vec::new();
    }
    let (effects, _) = candidates(model);
    let mut open: Vec<EffectUnderLaw> = match loads(model) {
        Some(loads) => acting_in(&effects, &loads),
        None => EffectUnderLaw::without_laws(&effects),
    };
    let number = match plan.effects {
        Some(most) => rng.random_range(0..=most),
        None => {
            let mut left: f64 = rng.random();
            let sizes = SIZES.iter().take_while(|p| {
                left -= *p;
                left > 0.0
            });
            sizes.count()
        }
    };
    let mut acted: Vec<EffectUnderLaw> = Vec::new();
    while acted.len() < number.max(usize::from(plan.withheld)) && !open.is_empty() {
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
