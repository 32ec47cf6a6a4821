//! Constants from peaks: the mode of the posterior, with the assignment summed over, and its curvature (Laplace's approximation).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::assignment::{Assigned, FrequencyPeak, PeakModel, PredictedFrequency, assign};
use super::plate::{PlateParameter, VibratingPlate};
use super::ritz::{Ritz, VibrationMode};
use crate::error::{Error, Result};

/// Scale of the logistic distribution of sd 1: sqrt(3) / pi.
const LOGISTIC_SCALE: f64 = 0.551_328_895_421_792;

/// A parameter that is not known, with its normal prior; units as in [`VibratingPlate`].
#[derive(Debug, Clone, Copy)]
pub struct Unknown {
    pub parameter: PlateParameter,
    pub mean: f64,
    pub sd: f64,
}

/// Peaks of a plate some parameters of which are unknown.
#[derive(Debug, Clone, Copy)]
pub struct AssignmentProblem<'a> {
    /// With matrices for what the plate has (air, point mass); a reduced one is fast.
    pub ritz: &'a Ritz,
    /// What is known; values of the unknown parameters do not matter.
    pub plate: &'a VibratingPlate,
    pub unknowns: &'a [Unknown],
    pub peaks: &'a [FrequencyPeak],
    pub model: &'a PeakModel,
    /// Number of modes to predict: enough to pass the band's upper end.
    pub modes: usize,
}

/// The best constants.
#[derive(Debug, Clone)]
pub struct LikeliestPlate {
    /// In the order of the unknowns.
    pub values: DVector<f64>,
    /// The same in prior standard deviations from the prior means.
    pub place: DVector<f64>,
    /// Inverse curvature of the log posterior.
    pub covariance: DMatrix<f64>,
    pub log_posterior: f64,
    /// Log of the evidence by Laplace: the posterior's integral.
    pub log_evidence: f64,
    pub plate: VibratingPlate,
    pub modes: Vec<VibrationMode>,
    pub assigned: Assigned,
}

impl LikeliestPlate {
    /// Standard deviation of an unknown.
    pub fn sd(&self, unknown: usize) -> f64 {
        self.covariance[(unknown, unknown)].sqrt()
    }
}

/// The log posterior about a point, in prior standard deviations.
struct LocalPosterior {
    log_posterior: f64,
    gradient: DVector<f64>,
    /// Expected information: of the peaks under the posterior assignment, and the prior's.
    information: DMatrix<f64>,
    modes: Vec<VibrationMode>,
    assigned: Assigned,
}

impl AssignmentProblem<'_> {
    /// The plate at `z` prior standard deviations from the prior means.
    fn plate_at(&self, z: &DVector<f64>) -> VibratingPlate {
        let each = self.unknowns.iter().zip(z.iter());
        each.fold(self.plate.clone(), |plate, (u, z)| {
            plate.with(u.parameter, u.mean + z * u.sd)
        })
    }

    fn at(&self, z: &DVector<f64>, model: &PeakModel) -> Result<LocalPosterior> {
        let plate = self.plate_at(z);
        plate.validate()?;
        let modes = self.ritz.modes(&plate.coefficients(), self.modes)?;
        let predicted: Vec<PredictedFrequency> = modes.iter().map(predicted).collect();
        let assigned = assign(model, self.peaks, &predicted)?;
        let parameters: Vec<PlateParameter> = self.unknowns.iter().map(|u| u.parameter).collect();
        let mut gradient = -z.clone();
        let mut information = DMatrix::identity(z.len(), z.len());
        for (j, mode) in modes.iter().enumerate() {
            let slope = self.ritz.sensitivities_hz(mode, &plate, &parameters);
            let scaled = slope.iter().zip(self.unknowns);
            let relative = scaled.map(|(s, u)| s * u.sd / mode.frequency_hz());
            let relative = DVector::from_iterator(z.len(), relative);
            gradient.axpy(assigned.slope[j], &relative, 1.0);
            let weight = self.peaks.iter().enumerate();
            let weight: f64 = weight
                .map(|(i, peak)| assigned.matched[(j, i)] / model.spread(peak).powi(2))
                .sum();
            information.ger(weight, &relative, &relative, 1.0);
        }
        Ok(LocalPosterior {
            log_posterior: assigned.log_likelihood - 0.5 * z.norm_squared(),
            gradient,
            information,
            modes,
            assigned,
        })
    }

    /// Climb from `z` with a model error, by damped Gauss-Newton steps.
    fn climb(
        &self,
        mut z: DVector<f64>,
        model: &PeakModel,
        steps: usize,
    ) -> Result<(DVector<f64>, LocalPosterior)> {
        /// Gain below which the top is reached.
        const LEAST_GAIN: f64 = 1e-7;
        let mut here = self.at(&z, model)?;
        let mut damping = 1e-3;
        for _ in 0..steps {
            let mut damped = here.information.clone();
            (0..z.len()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            let Some(factor) = damped.cholesky() else {
                break;
            };
            let to = &z + factor.solve(&here.gradient);
            // inadmissible constants are a step too far, nothing worse
            match self.at(&to, model) {
                Ok(there) if there.log_posterior > here.log_posterior => {
                    let gain = there.log_posterior - here.log_posterior;
                    (z, here) = (to, there);
                    damping *= 0.2;
                    if gain < LEAST_GAIN {
                        break;
                    }
                }
                _ if damping > 1e8 => break,
                _ => damping = (damping * 8.0).max(1e-3),
            }
        }
        Ok((z, here))
    }

    /// Climb with a model error that shrinks to the stated one: far peaks pull first.
    fn anneal(&self, z: DVector<f64>) -> Result<(DVector<f64>, LocalPosterior)> {
        /// First model error, and the factor between two.
        const FIRST: f64 = 0.06;
        const FACTOR: f64 = 0.6;
        /// Steps on the way, where the top need not be reached, and at the end.
        const STEPS: [usize; 2] = [6, 60];
        let mut z = z;
        let mut error = FIRST;
        while error > self.model.model_error {
            let model = PeakModel {
                model_error: error,
                ..*self.model
            };
            z = self.climb(z, &model, STEPS[0])?.0;
            error *= FACTOR;
        }
        self.climb(z, self.model, STEPS[1])
    }

    /// Minus the second derivatives of the log posterior, by differences of its gradient.
    fn curvature(&self, z: &DVector<f64>, information: &DMatrix<f64>) -> Result<DMatrix<f64>> {
        /// Step as a share of the expected posterior sd.
        const STEP: f64 = 0.02;
        let n = z.len();
        let mut curvature = DMatrix::zeros(n, n);
        for i in 0..n {
            let step = STEP / information[(i, i)].sqrt();
            let side = |sign: f64| {
                let mut to = z.clone();
                to[i] += sign * step;
                self.at(&to, self.model)
            };
            let change = side(-1.0)?.gradient - side(1.0)?.gradient;
            curvature.set_column(i, &(change / (2.0 * step)));
        }
        Ok(0.5 * (&curvature + curvature.transpose()))
    }
}

/// Frequency and parity of a mode.
pub fn predicted(mode: &VibrationMode) -> PredictedFrequency {
    PredictedFrequency {
        frequency_hz: mode.frequency_hz(),
        odd: mode.odd,
    }
}

/// The tops of the posterior, highest first, that are reached from the prior means and from `starts` further points of the prior (Halton's
/// sequence); each once.
///
/// # Errors
/// The input's fault: prior means that no plate has; no start that leads anywhere.
pub fn estimates(problem: &AssignmentProblem<'_>, starts: usize) -> Result<Vec<LikeliestPlate>> {
    /// Tops nearer to each other than this, in log posterior and prior standard deviations, are one.
    const SAME: f64 = 1e-3;
    let n = problem.unknowns.len();
    problem.at(&DVector::zeros(n), problem.model)?;
    let points: Vec<DVector<f64>> = (0..=starts)
        .map(|k| DVector::from_fn(n, |i, _| if k == 0 { 0.0 } else { quasi_normal(k, i) }))
        .collect();
    let mut tops: Vec<_> = points
        .into_par_iter()
        .filter_map(|z| problem.anneal(z).ok())
        .collect();
    tops.sort_by(|a, b| b.1.log_posterior.total_cmp(&a.1.log_posterior));
    let mut distinct: Vec<LikeliestPlate> = Vec::new();
    for (z, top) in tops {
        let is_known = distinct.iter().any(|d| {
            (d.log_posterior - top.log_posterior).abs() < SAME && (&d.place - &z).amax() < SAME
        });
        if !is_known {
            distinct.push(problem.completed(z, top)?);
        }
    }
    if distinct.is_empty() {
        let expected = "a prior within which a plate exists";
        return Err(Error::input("natural frequencies", expected));
    }
    Ok(distinct)
}

impl AssignmentProblem<'_> {
    /// A top with its curvature.
    fn completed(&self, z: DVector<f64>, top: LocalPosterior) -> Result<LikeliestPlate> {
        // where the curvature is not that of a top (a kink, a flank at the edge of what is admissible) the expected information stands in
        let exact = self.curvature(&z, &top.information).ok();
        let factor = exact
            .and_then(|curvature| curvature.cholesky())
            .or_else(|| top.information.clone().cholesky())
            .ok_or_else(|| {
                Error::program("natural frequencies", "a positive definite information")
            })?;
        let sd = self.unknowns.iter().map(|u| u.sd);
        let scales = DMatrix::from_diagonal(&DVector::from_iterator(z.len(), sd));
        let values = self.unknowns.iter().zip(z.iter());
        Ok(LikeliestPlate {
            values: DVector::from_iterator(z.len(), values.map(|(u, z)| u.mean + z * u.sd)),
            covariance: &scales * factor.inverse() * &scales,
            log_posterior: top.log_posterior,
            log_evidence: top.log_posterior - factor.l().diagonal().map(f64::ln).sum(),
            plate: self.plate_at(&z),
            place: z,
            modes: top.modes,
            assigned: top.assigned,
        })
    }
}

/// Coordinate `axis` of point `k` > 0 of a sequence that fills the prior: Halton's, made nearly normal by the logistic quantile.
fn quasi_normal(k: usize, axis: usize) -> f64 {
    const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
    let base = PRIMES[axis % PRIMES.len()];
    let (mut rest, mut share, mut u) = (k, 1.0, 0.0);
    while rest > 0 {
        share /= base as f64;
        u += share * (rest % base) as f64;
        rest /= base;
    }
    LOGISTIC_SCALE * (u / (1.0 - u)).ln()
}
