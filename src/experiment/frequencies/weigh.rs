//! What the posterior says beyond its highest top: importance sampling about all tops.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::estimate::{AssignmentProblem, LOGISTIC_SCALE, LikeliestPlate, quasi_normal};
use crate::error::{Error, Result};
use crate::numeric::shares;

/// Means over the posterior.
#[derive(Debug, Clone)]
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
    fn of(problem: &AssignmentProblem<'_>, top: &LikeliestPlate) -> Result<Self> {
        let n = top.place.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            top.covariance[(i, j)] / (problem.unknowns[i].sd * problem.unknowns[j].sd)
        });
        let spread = covariance.cholesky().map(|factor| factor.l());
        let inverse = spread.as_ref().and_then(|s| s.clone().try_inverse());
        match (spread, inverse) {
            (Some(spread), Some(whitening)) => Ok(Self {
                place: top.place.clone(),
                log_norm: -spread.diagonal().map(f64::ln).sum(),
                spread,
                whitening,
            }),
            _ => Err(Error::program(
                "natural frequencies",
                "a positive definite covariance",
            )),
        }
    }

    /// Point `k` > 0 of the proposal's sequence.
    fn point(&self, k: usize) -> DVector<f64> {
        &self.place + &self.spread * DVector::from_fn(self.place.len(), |i, _| quasi_normal(k, i))
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

/// Average over the posterior by about `draws` points, shared out among the tops (highest first) by their evidence. Deterministic.
///
/// # Errors
/// The input's fault without tops; the program's if a covariance is not positive definite.
pub fn weigh(
    problem: &AssignmentProblem<'_>,
    tops: &[LikeliestPlate],
    draws: usize,
) -> Result<WeighedPlates> {
    /// Least share of the draws that a top is given: Laplace's evidence may be wrong by as much.
    const LEAST: f64 = 0.05;
    let Some(first) = tops.first() else {
        return Err(Error::input("natural frequencies", "at least one estimate"));
    };
    let highest = tops.iter().map(|t| t.log_evidence).fold(f64::MIN, f64::max);
    let evidence: Vec<f64> = tops
        .iter()
        .map(|t| (t.log_evidence - highest).exp())
        .collect();
    let sum: f64 = evidence.iter().sum();
    let mut proposals = Vec::new();
    for (top, share) in tops.iter().zip(evidence) {
        let count = ((share / sum).max(LEAST) * draws as f64).ceil() as usize;
        proposals.push((PlateProposal::of(problem, top)?, count));
    }
    let total: usize = proposals.iter().map(|(_, count)| count).sum();
    let points: Vec<DVector<f64>> = proposals
        .iter()
        .flat_map(|(proposal, count)| (1..=*count).map(|k| proposal.point(k)))
        .collect();
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
        .map(|z| match problem.at(z, problem.model) {
            Ok(local) => {
                let matched = DMatrix::from_fn(first.modes.len(), problem.peaks.len(), |j, i| {
                    let same = local.modes.iter().position(|m| m.is(&first.modes[j]));
                    same.map_or(0.0, |row| local.assigned.matched[(row, i)])
                });
                (local.log_posterior - log_mixture(z), matched)
            }
            Err(_) => (f64::NEG_INFINITY, DMatrix::zeros(0, 0)),
        })
        .collect();
    averaged(problem, first, &points, &drawn)
}

fn averaged(
    problem: &AssignmentProblem<'_>,
    first: &LikeliestPlate,
    points: &[DVector<f64>],
    drawn: &[(f64, DMatrix<f64>)],
) -> Result<WeighedPlates> {
    let n = first.place.len();
    let logs: Vec<f64> = drawn.iter().map(|d| d.0).collect();
    let weights = shares(&logs);
    if !weights.iter().all(|w| w.is_finite()) {
        return Err(Error::program(
            "natural frequencies",
            "draws that some plate has",
        ));
    }
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
    Ok(WeighedPlates {
        mean,
        covariance,
        matched,
        effective: 1.0 / weights.iter().map(|w| w * w).sum::<f64>(),
    })
}
