//! Simulation-based calibration (Talts et al. 2018): draws from the prior, simulated measurements of them, the whole
//! identification of each, and where the truth lies among the posterior's draws.
//!
//! With 200 replicates each (about half an hour of one core) the ranks of the four constants are uniform (Kolmogorov-Smirnov
//! p between 0.2 and 0.9) and their 90 % intervals hold 86 to 92 % of the truths, with white noise and with noise correlated
//! over 1 mm (two seeds) alike. Those of `noise_nm` are so in white noise (p = 0.7, 88 % held); in noise correlated over 1 mm
//! (p = 0.02 and 0.08, 92 % held) it is a quarter and an eighth of its sd too large on average, as noise correlated over
//! 1 mm might have a white part.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

pub use super::replicates::ReplicatePlan;
use super::replicates::{Numbered, replicates};
use super::twin::{Twin, TwinTruth};
use crate::chain::Draws;
use crate::diagnose::Rule;
use crate::error::Result;
use crate::identify::start;
use crate::infer::Model;
use crate::progress::Progress;
use crate::sample::{Ensemble, LogDensity, Quiet, Schedule, Start, run};

/// The true noise sd is drawn from this interval, evenly in its logarithm (the posterior's prior is 1/noise), nm.
pub const NOISE_NM: [f64; 2] = [3.0, 30.0];

/// A rank is the number of this many draws below the truth.
pub const RANK_DRAWS: usize = 99;

/// Levels of the intervals whose coverage is counted.
pub const LEVELS: [f64; 3] = [0.5, 0.9, 0.95];

/// One line of the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    pub replicate: usize,
    /// True value of each parameter.
    pub truth: Vec<f64>,
    /// Posterior mean and sd of each parameter.
    pub mean: Vec<f64>,
    /// See `mean`.
    pub sd: Vec<f64>,
    /// Number of [`RANK_DRAWS`] draws below the truth.
    pub rank: Vec<usize>,
    /// Share of all draws below the truth.
    pub below: Vec<f64>,
    pub converged: bool,
}

/// How one parameter fared.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterRanks {
    pub name: String,
    /// p-value of the Kolmogorov-Smirnov test of the shares below the truth against uniformity.
    pub p_ks: f64,
    /// p-value of the chi^2 test of the ranks over ten bins.
    pub p_ranks: f64,
    /// Ranks in ten bins.
    pub bins: [usize; 10],
    /// Covered truths at each of [`LEVELS`].
    pub covered: [usize; 3],
    /// Mean and root mean square of (posterior mean - truth) / posterior sd.
    pub z: [f64; 2],
}

#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    pub plan: ReplicatePlan,
    /// Replicates done, and those whose chains converged.
    pub done: [usize; 2],
    pub parameters: Vec<ParameterRanks>,
    /// For each of [`LEVELS`] the counts between which a calibrated posterior lies in 99 % of cases.
    pub bands: [[usize; 2]; 3],
}

/// The model that is calibrated: unnamed model errors are left out, because nothing of them is simulated.
pub fn model_of(model: &Model) -> Model {
    let mut model = model.clone();
    model.file.likelihood.model_error_fraction = 0.0;
    model.file.likelihood.noise_nm = None;
    model
}

/// Run or go on with a record at `path` (one line a replicate), and return all replicates.
///
/// # Errors
/// A record of another plan; what simulation and identification may fail with.
pub fn calibrate(
    model: &Model,
    twin: &Twin,
    plan: &ReplicatePlan,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Vec<Replicate>> {
    let noise = if plan.correlation_mm == 0.0 {
        "white noise".to_string()
    } else {
        format!("noise correlated over {} mm", plan.correlation_mm)
    };
    let one = |k: usize| identify(model, twin, plan, k);
    let what = format!("calibration, {noise}");
    replicates((path, &model.file), plan, (&what, &one), progress)
}

impl Numbered for Replicate {
    fn replicate(&self) -> usize {
        self.replicate
    }
}

impl Replicate {
    /// One parameter alone.
    pub fn only(&self, k: usize) -> Self {
        Self {
            replicate: self.replicate,
            truth: vec![self.truth[k]],
            mean: vec![self.mean[k]],
            sd: vec![self.sd[k]],
            rank: vec![self.rank[k]],
            below: vec![self.below[k]],
            converged: self.converged,
        }
    }
}

/// Where the truth lies among draws: the names of what they know of it, and the replicate.
pub fn of_draws(
    draws: &Draws,
    truth: &[(String, f64)],
    replicate: usize,
) -> (Vec<String>, Replicate) {
    let n = draws.len() as f64;
    let stride = (draws.len() / RANK_DRAWS).max(1);
    let mut names = Vec::new();
    let mut result = Replicate {
        replicate,
        truth: Vec::new(),
        mean: Vec::new(),
        sd: Vec::new(),
        rank: Vec::new(),
        below: Vec::new(),
        converged: true,
    };
    for (name, truth) in truth {
        let Some(k) = draws.index(name) else {
            continue;
        };
        let mean = draws.points().map(|x| x[k]).sum::<f64>() / n;
        let variance = draws.points().map(|x| (x[k] - mean).powi(2)).sum::<f64>() / n;
        let some = draws.points().skip(stride / 2).step_by(stride);
        let below = draws.points().filter(|x| x[k] < *truth).count();
        names.push(name.clone());
        result.truth.push(*truth);
        result.mean.push(mean);
        result.sd.push(variance.sqrt());
        let some = some.take(RANK_DRAWS);
        result.rank.push(some.filter(|x| x[k] < *truth).count());
        result.below.push(below as f64 / n);
    }
    (names, result)
}

/// A draw from the prior.
fn draw(model: &Model, plan: &ReplicatePlan, replicate: usize) -> TwinTruth {
    let mut rng = Pcg64Dxsm::seed_from_u64(plan.seed_of(replicate, 1));
    let mut theta = constants(model, &mut rng);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for parameter in model.sampled().iter().flat_map(|e| e.parameters()) {
        theta.push(parameter.prior_sd.unwrap_or(parameter.bound) * normal());
    }
    let thickness = model.loaded_thickness_mm();
    let additive = model.additive();
    let additive = additive.iter().flat_map(|e| e.parameters());
    // an amplitude with a flat prior is as good as any other
    let additive = additive
        .map(|p| p.prior_sd.unwrap_or(0.0) * normal())
        .collect();
    let thickness_mm = thickness.mean + thickness.sd * normal();
    let [low, high] = NOISE_NM;
    TwinTruth {
        theta,
        additive,
        thickness_mm,
        noise_nm: low * (high / low).powf(rng.random()),
    }
}

/// Constants from their priors, that a ply can have.
pub(super) fn constants(model: &Model, rng: &mut Pcg64Dxsm) -> Vec<f64> {
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

fn identify(
    model: &Model,
    twin: &Twin,
    plan: &ReplicatePlan,
    replicate: usize,
) -> Result<Replicate> {
    let truth = draw(model, plan, replicate);
    let u = twin.finite_elements(&truth)?;
    let seed = plan.seed_of(replicate, 2);
    let noise = twin.noise(truth.noise_nm, plan.correlation_mm, seed);
    let posterior = twin.posterior(model, u, &noise)?.posed.density;
    let mode = start(&posterior)?;
    let ball = Start::Ball {
        centre: &mode.mode,
        covariance: &mode.covariance,
        spread: 3.0,
    };
    let schedule = Schedule {
        seed: plan.seed_of(replicate, 3),
        ..Schedule::default()
    };
    let rule = Rule::default();
    let outcome = run(
        &posterior,
        &Ensemble::default(),
        &ball,
        &schedule,
        &rule,
        &Quiet,
    )?;
    let mut values = truth.theta[..posterior.constants()].to_vec();
    values.push(truth.noise_nm);
    let known = posterior.names().iter().cloned().zip(values);
    let known: Vec<(String, f64)> = known.collect();
    let (_, found) = of_draws(&outcome.draws, &known, replicate);
    Ok(Replicate {
        converged: matches!(outcome.stopped, crate::sample::Stopped::Enough),
        ..found
    })
}

/// Rank statistics, uniformity and coverage of replicates.
pub fn summarise(plan: &ReplicatePlan, names: &[String], replicates: &[Replicate]) -> Summary {
    let n = replicates.len();
    let parameter = |(k, name): (usize, &String)| {
        let mut bins = [0; 10];
        let mut covered = [0; 3];
        for r in replicates {
            bins[r.rank[k] * 10 / (RANK_DRAWS + 1)] += 1;
            for (count, level) in covered.iter_mut().zip(LEVELS) {
                *count += usize::from((r.below[k] - 0.5).abs() <= 0.5 * level);
            }
        }
        let z = || {
            replicates
                .iter()
                .map(|r| (r.mean[k] - r.truth[k]) / r.sd[k])
        };
        let count = n.max(1) as f64;
        ParameterRanks {
            name: name.clone(),
            p_ks: kolmogorov(replicates.iter().map(|r| r.below[k]).collect()),
            p_ranks: chi_square(&bins),
            bins,
            covered,
            z: [
                z().sum::<f64>() / count,
                (z().map(|z| z * z).sum::<f64>() / count).sqrt(),
            ],
        }
    };
    Summary {
        plan: plan.clone(),
        done: [n, replicates.iter().filter(|r| r.converged).count()],
        parameters: names.iter().enumerate().map(parameter).collect(),
        bands: LEVELS.map(|level| band(n, level)),
    }
}

/// Central interval that holds a binomial count in at least 99 % of cases.
pub fn band(n: usize, level: f64) -> [usize; 2] {
    let Ok(distribution) = Binomial::new(level, n as u64) else {
        return [0, n];
    };
    [0.005, 0.995].map(|p| distribution.inverse_cdf(p) as usize)
}

/// p-value of equal expected counts.
fn chi_square(bins: &[usize]) -> f64 {
    let n: usize = bins.iter().sum();
    let expected = n as f64 / bins.len() as f64;
    if n == 0 {
        return f64::NAN;
    }
    let chi2: f64 = bins
        .iter()
        .map(|&b| (b as f64 - expected).powi(2) / expected)
        .sum();
    ChiSquared::new((bins.len() - 1) as f64).map_or(f64::NAN, |d| d.sf(chi2))
}

/// p-value of the Kolmogorov-Smirnov test of uniformity on [0, 1] (asymptotic, with Stephens' correction for few values).
pub fn kolmogorov(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let distance = values.iter().enumerate().fold(0.0_f64, |d, (i, &v)| {
        d.max(v - i as f64 / n).max((i + 1) as f64 / n - v)
    });
    let x = distance * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    if x < 0.2 {
        return 1.0;
    }
    let term = |k: i32| (-1.0_f64).powi(k - 1) * (-2.0 * f64::from(k * k) * x * x).exp();
    (2.0 * (1..=100).map(term).sum::<f64>()).clamp(0.0, 1.0)
}
