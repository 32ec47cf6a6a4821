//! What the posterior says beyond its highest top: importance sampling about all tops.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use plychain::experiment::frequencies::VibrationMode;
use plychain::experiment::frequencies::assignment::{Assigned, assign};
use plychain::experiment::frequencies::estimate::{AssignmentProblem, LikeliestPlate, predicted};
use plychain::numeric::shares;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Scale of the logistic distribution of sd 1: sqrt(3) / pi.
const LOGISTIC_SCALE: f64 = 0.551_328_895_421_792;

/// Means over the posterior.
pub struct WeighedPlates {
    /// Mean and covariance of the unknowns, in their units.
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Probability that a mode (row, of the first estimate) is a peak (column), whatever the constants.
    pub matched: DMatrix<f64>,
    /// Number of independent draws that would say as much.
    pub effective: f64,
}

impl WeighedPlates {
    /// Probability that a peak is no mode.
    pub fn additional(&self, peak: usize) -> f64 {
        (1.0 - self.matched.column(peak).sum()).clamp(0.0, 1.0)
    }
}

/// A top's Laplace approximation with the tails of a logistic distribution.
struct PlateProposal {
    place: DVector<f64>,
    /// Whitened to prior standard deviations.
    spread: DMatrix<f64>,
    whitening: DMatrix<f64>,
    log_norm: f64,
}

impl PlateProposal {
    fn of(problem: &AssignmentProblem<'_>, top: &LikeliestPlate) -> Self {
        let n = top.place.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            top.covariance[(i, j)] / (problem.unknowns[i].sd * problem.unknowns[j].sd)
        });
        let spread = covariance.cholesky().unwrap().l();
        Self {
            place: top.place.clone(),
            log_norm: -spread.diagonal().map(f64::ln).sum(),
            whitening: spread.clone().try_inverse().unwrap(),
            spread,
        }
    }

    /// A draw, each whitened coordinate of a logistic law.
    fn draw(&self, rng: &mut Pcg64) -> DVector<f64> {
        let mut logistic = |_, _| {
            let u: f64 = rng.random();
            LOGISTIC_SCALE * (u / (1.0 - u)).ln()
        };
        &self.place + &self.spread * DVector::from_fn(self.place.len(), &mut logistic)
    }

    /// Log density.
    fn log_density(&self, z: &DVector<f64>) -> f64 {
        let white = &self.whitening * (z - &self.place);
        let each = white.iter().map(|w| {
            let t = (w / LOGISTIC_SCALE).abs();
            -t - 2.0 * (-t).exp().ln_1p() - LOGISTIC_SCALE.ln()
        });
        self.log_norm + each.sum::<f64>()
    }
}

/// Log posterior, modes and assignment at `z` prior standard deviations from the prior means; none where no plate exists.
fn at(
    problem: &AssignmentProblem<'_>,
    z: &DVector<f64>,
) -> Option<(f64, Vec<VibrationMode>, Assigned)> {
    let each = problem.unknowns.iter().zip(z.iter());
    let plate = each.fold(problem.plate.clone(), |plate, (u, z)| {
        plate.with(u.parameter, u.mean + z * u.sd)
    });
    plate.validate().ok()?;
    let modes = problem
        .ritz
        .modes(&plate.coefficients(), problem.modes)
        .ok()?;
    let frequencies: Vec<_> = modes.iter().map(predicted).collect();
    let assigned = assign(problem.model, problem.peaks, &frequencies).ok()?;
    let log_posterior = assigned.log_likelihood - 0.5 * z.norm_squared();
    Some((log_posterior, modes, assigned))
}

/// Average over the posterior by about `draws` points, shared out among the tops (highest first) by their evidence, with numbers of one seed.
pub fn weigh(
    problem: &AssignmentProblem<'_>,
    tops: &[LikeliestPlate],
    draws: usize,
) -> WeighedPlates {
    /// Least share of the draws that a top is given: Laplace's evidence may be wrong by as much.
    const LEAST: f64 = 0.05;
    let first = &tops[0];
    let highest = tops.iter().map(|t| t.log_evidence).fold(f64::MIN, f64::max);
    let evidence: Vec<f64> = tops
        .iter()
        .map(|t| (t.log_evidence - highest).exp())
        .collect();
    let sum: f64 = evidence.iter().sum();
    let mut proposals = Vec::new();
    for (top, share) in tops.iter().zip(evidence) {
        let count = ((share / sum).max(LEAST) * draws as f64).ceil() as usize;
        proposals.push((PlateProposal::of(problem, top), count));
    }
    let total: usize = proposals.iter().map(|(_, count)| count).sum();
    let rng = &mut Pcg64::seed_from_u64(1);
    let mut points: Vec<DVector<f64>> = Vec::new();
    for (proposal, count) in &proposals {
        points.extend((0..*count).map(|_| proposal.draw(rng)));
    }
    let log_mixture = |z: &DVector<f64>| {
        let each = proposals.iter();
        let density: f64 = each
            .map(|(p, count)| *count as f64 / total as f64 * p.log_density(z).exp())
            .sum();
        density.ln()
    };
    // a point where no plate exists weighs nothing
    let drawn: Vec<(f64, DMatrix<f64>)> = points
        .par_iter()
        .map(|z| match at(problem, z) {
            Some((log_posterior, modes, assigned)) => {
                let matched = DMatrix::from_fn(first.modes.len(), problem.peaks.len(), |j, i| {
                    let same = modes.iter().position(|m| m.is(&first.modes[j]));
                    same.map_or(0.0, |row| assigned.matched[(row, i)])
                });
                (log_posterior - log_mixture(z), matched)
            }
            None => (f64::NEG_INFINITY, DMatrix::zeros(0, 0)),
        })
        .collect();
    averaged(problem, first, &points, &drawn)
}

fn averaged(
    problem: &AssignmentProblem<'_>,
    first: &LikeliestPlate,
    points: &[DVector<f64>],
    drawn: &[(f64, DMatrix<f64>)],
) -> WeighedPlates {
    let n = first.place.len();
    let logs: Vec<f64> = drawn.iter().map(|d| d.0).collect();
    let weights = shares(&logs);
    assert!(weights.iter().all(|w| w.is_finite()));
    let units = |z: &DVector<f64>| {
        let each = problem.unknowns.iter().zip(z.iter());
        DVector::from_iterator(n, each.map(|(u, z)| u.mean + z * u.sd))
    };
    let mut mean = DVector::zeros(n);
    let mut matched = DMatrix::zeros(first.modes.len(), problem.peaks.len());
    for ((weight, z), (_, shares)) in weights.iter().zip(points).zip(drawn) {
        if *weight > 0.0 {
            mean.axpy(*weight, &units(z), 1.0);
            matched += shares * *weight;
        }
    }
    let mut covariance = DMatrix::zeros(n, n);
    for (weight, z) in weights.iter().zip(points) {
        let off = units(z) - &mean;
        covariance.ger(*weight, &off, &off, 1.0);
    }
    WeighedPlates {
        mean,
        covariance,
        matched,
        effective: 1.0 / weights.iter().map(|w| w * w).sum::<f64>(),
    }
}
