//! The population's posterior: draws in the units of the constants, and every specimen given all others.

use nalgebra::DVector;

use super::density::{NormalPopulation, Population};
use super::specimen::Specimen;
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose};
use crate::error::{Error, Result};
use crate::identify::Reporting;
use crate::numeric::diagonal;
use crate::parameter::is_modulus;
use crate::progress::Progress;
use crate::sample::{self, Adaptive, Key, Schedule, Start, Stream};

/// Fewest specimens that have a spread to speak of.
pub const LEAST: usize = 3;

/// Standard normal quantiles of the 1st and the 10th percentile.
const Z_1: f64 = -2.326_347_874_040_841;
const Z_10: f64 = -1.281_551_565_544_600_4;

/// The key of streams that no walker has: a lane a specimen, and one for the shared scale.
fn own(seed: u64) -> Key {
    Key {
        seed,
        ensemble: u64::MAX,
    }
}
const SCALES: u64 = u64::MAX;

/// What was drawn.
pub struct Sampled {
    pub constants: Vec<String>,
    /// `mean_`, `sd_`, `percentile_1_` and `percentile_10_` of every constant, and `correlation_` of every two.
    pub draws: Draws,
    pub verdict: Verdict,
    /// Draws of every specimen's constants given all specimens, specimen by constant.
    pub shrunken: Vec<Vec<Vec<f64>>>,
}

/// Chains start in balls of this many sds.
const SPREAD: f64 = 1.5;

/// Effective draws of an ensemble: bounds lie in the tails.
const ESS: f64 = 800.0;

/// The tau of heavy tails keeps moving when there are draws enough.
const TAU_CHANGE: f64 = 0.1;

/// Draws of the population at which specimens are drawn.
const AT: usize = 4000;

/// Draw from the posterior of the population of some specimens, which have a scale of all their moduli in common that is known with a relative
/// sd of `shared` (see [`Specimen::without_scale`]).
///
/// # Errors
/// The input's fault: fewer than [`LEAST`] specimens, or specimens of different constants.
pub fn sample(
    specimens: &[Specimen],
    shared: f64,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Sampled> {
    let constants = match specimens {
        [first, ..] if specimens.len() >= LEAST => first.constants.clone(),
        _ => {
            let wanted = format!("at least {LEAST} specimens that are done");
            return Err(Error::input("population", wanted).found(specimens.len()));
        }
    };
    if let Some(other) = specimens.iter().find(|s| s.constants != constants) {
        let wanted = format!("the same constants in every run: {}", constants.join(", "));
        return Err(Error::input(&other.name, wanted).found(other.constants.join(", ")));
    }
    let target = Population::new(specimens);
    let (centre, sds) = target.start();
    let covariance = diagonal(sds.iter().map(|sd| sd * sd));
    let start = Start::Ball {
        centre: &centre,
        covariance: &covariance,
        spread: SPREAD,
    };
    let schedule = Schedule {
        seed,
        ..Schedule::default()
    };
    let rule = Rule {
        ess: ESS,
        tau_change: TAU_CHANGE,
        ..Rule::default()
    };
    let monitor = Reporting {
        progress,
        deadline: None,
    };
    progress.begin("posterior of the population", None);
    let sampler = Adaptive::default();
    let outcome = sample::run(&target, &sampler, &start, &schedule, &rule, &monitor)?;
    progress.end();
    let mut scales = Stream::at(own(seed), SCALES, 0);
    let draws = in_units(&target, &constants, &outcome.draws, &mut || {
        1.0 + shared * scales.normal()
    })?;
    Ok(Sampled {
        verdict: judge(&outcome.draws, &draws, &rule),
        shrunken: shrunken(&target, specimens, &outcome.draws, seed),
        constants,
        draws,
    })
}

/// Sampled coordinates are held to the whole rule; percentiles of few specimens, whose tails are those of a t distribution, to that of ranks.
fn judge(sampled: &Draws, in_units: &Draws, rule: &Rule) -> Verdict {
    let mut verdict = diagnose(
        in_units,
        &Rule {
            tau_change: f64::INFINITY,
            ..*rule
        },
    );
    verdict.reasons.extend(diagnose(sampled, rule).reasons);
    verdict.converged = verdict.reasons.is_empty();
    verdict
}

fn in_units(
    target: &Population<'_>,
    constants: &[String],
    drawn: &Draws,
    scale: &mut dyn FnMut() -> f64,
) -> Result<Draws> {
    let of = |what: &str| {
        constants
            .iter()
            .map(move |c| format!("{what}_{c}"))
            .collect::<Vec<_>>()
    };
    let mut names = of("mean");
    names.extend(of("sd"));
    names.extend(of("percentile_1"));
    names.extend(of("percentile_10"));
    let n = constants.len();
    let pairs = || (1..n).flat_map(|i| (0..i).map(move |j| (j, i)));
    names.extend(pairs().map(|(j, i)| format!("correlation_{}_{}", constants[j], constants[i])));
    let mut values = Vec::with_capacity(drawn.len() * names.len());
    for x in drawn.points() {
        let (mut place, _) = target.place(x);
        let scale = scale();
        for (k, name) in constants.iter().enumerate() {
            if is_modulus(name) {
                place.mean[k] *= scale;
                place.sds[k] *= scale;
            }
        }
        let with = |z: f64| {
            place
                .mean
                .iter()
                .zip(&place.sds)
                .map(move |(m, s)| m + z * s)
        };
        values.extend(place.mean.iter());
        values.extend(&place.sds);
        values.extend(with(Z_1));
        values.extend(with(Z_10));
        values.extend(pairs().map(|(j, i)| place.root.row(j).dot(&place.root.row(i))));
    }
    let mut draws = Draws::new(
        names,
        drawn.ensemble().to_vec(),
        values,
        drawn.lp().to_vec(),
    )?;
    draws.info = drawn.info.clone();
    Ok(draws)
}

fn shrunken(
    target: &Population<'_>,
    specimens: &[Specimen],
    drawn: &Draws,
    seed: u64,
) -> Vec<Vec<Vec<f64>>> {
    let points: Vec<&[f64]> = drawn.points().step_by((drawn.len() / AT).max(1)).collect();
    let one = |(s, specimen): (usize, &Specimen)| {
        let mut all = vec![Vec::with_capacity(points.len()); target.constants()];
        let mut rng = Stream::at(own(seed), s as u64, 0);
        for x in &points {
            let (place, _) = target.place(x);
            if let Some(theta) = draw(&place, specimen, &mut rng) {
                for (values, value) in all.iter_mut().zip(theta.iter()) {
                    values.push(*value);
                }
            }
        }
        all
    };
    specimens.iter().enumerate().map(one).collect()
}

/// A specimen's constants given the population: one of its kernels, and a normal draw from its product with the population.
fn draw(place: &NormalPopulation, specimen: &Specimen, rng: &mut Stream) -> Option<DVector<f64>> {
    let around = place.around(specimen)?;
    let (each, all) = place.of_kernels(specimen, &around);
    let mut left = rng.uniform() * each.len() as f64;
    let chosen = each.iter().position(|l| {
        left -= (l - all).exp();
        left < 0.0
    });
    let centre = &specimen.centres[chosen.unwrap_or(each.len() - 1)];
    let between = place.covariance();
    let gain = around.solve(&between).transpose();
    let mean = &place.mean + &gain * (centre - &place.mean);
    // Joseph's form, which rounding leaves positive definite
    let rest = nalgebra::DMatrix::identity(mean.len(), mean.len()) - &gain;
    let covariance =
        &rest * between * rest.transpose() + &gain * &specimen.kernel * gain.transpose();
    let root = covariance.cholesky()?.l();
    let z = DVector::from_fn(mean.len(), |_, _| rng.normal());
    Some(mean + root * z)
}
