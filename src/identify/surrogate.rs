//! The finite elements against the density at draws of the posterior.

use nalgebra::{DMatrix, DVector};

use super::inverse::InverseProblem;
use crate::chain::Draws;
use crate::diagnose::weigh;
use crate::error::Result;
use crate::files::stored;
use crate::numeric::shares;
use crate::posterior::{CompletedDraw, FullModels, Posed, PosedDraws};
use crate::quantity::NM_PER_MM;

/// What the density's own error does to the posterior, measured where the posterior is.
#[derive(Debug, Clone)]
pub struct SurrogateError {
    /// Number of draws at which the finite elements were solved.
    pub draws: usize,
    /// Name of each constant, and the largest shift of its posterior mode that the error causes at any of the draws, posterior sds.
    pub shift_sd: Vec<(String, f64)>,
    /// The mean of those shifts with their signs: what does not average out.
    pub bias_sd: Vec<f64>,
    /// Log likelihood by the finite elements minus that by the density, at each draw.
    pub log_weights: Vec<f64>,
    /// Moments of each constant over those draws, plain and with the finite elements' likelihood.
    pub moments: Vec<Reweighted>,
    /// Largest difference of the block averages, nm.
    pub max_field_nm: f64,
    /// Root mean square difference, nm.
    pub rms_field_nm: f64,
}

/// Mean and sd of a constant over the draws at which the finite elements were solved.
#[derive(Debug, Clone)]
pub struct Reweighted {
    pub name: String,
    /// With equal weights.
    pub plain: [f64; 2],
    /// With the importance weights of the finite elements' likelihood.
    pub weighted: [f64; 2],
}

/// Draws at which the finite elements are solved.
pub const CHECKED_DRAWS: usize = 12;

/// Largest error, posterior sds, that is not worth a word.
pub const TOLERANCE: f64 = 0.05;

stored!(SurrogateError {
    draws,
    shift_sd,
    bias_sd,
    log_weights,
    moments,
    max_field_nm,
    rms_field_nm
});
stored!(Reweighted {
    name,
    plain,
    weighted
});

impl SurrogateError {
    /// The largest shift of any constant, in posterior standard deviations.
    pub fn max_sd(&self) -> f64 {
        self.shift_sd.iter().fold(0.0, |a, (_, s)| a.max(*s))
    }

    /// Effective number of draws with the finite elements' likelihood: (sum w)^2 / sum w^2 of the importance weights.
    pub fn effective_draws(&self) -> f64 {
        let weights = shares(&self.log_weights);
        1.0 / weights.iter().map(|w| w * w).sum::<f64>()
    }

    /// Compare at some completed `points` of the draws.
    ///
    /// With an error d of the prediction, the posterior's gradient changes by g = grad (log L(d) - log L) and its mode by one Newton step,
    /// Sigma g, with Sigma the covariance of the draws.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn measure(
        run: &InverseProblem,
        draws: &Draws,
        (points, drawn): (&[Vec<f64>], &[CompletedDraw]),
        models: FullModels<'_>,
    ) -> Result<Self> {
        let posed = &run.posed;
        let names = posed.density.constant_names();
        let d = names.len();
        let compared = PosedDraws {
            posed,
            points,
            drawn,
        }
        .compared(models, CHECKED_DRAWS)?;
        let covariance = covariance(draws, d);
        let sd = DVector::from_fn(d, |k, _| covariance[(k, k)].sqrt());
        let mut largest = vec![0.0_f64; d];
        let mut bias = vec![0.0; d];
        let (mut max_field, mut sum, mut count) = (0.0_f64, 0.0, 0.0_f64);
        for (k, error) in &compared.errors {
            let products = posed.products(error)?;
            let shift = &covariance * gradient(posed, &points[*k], &sd, &products);
            for i in 0..d {
                let by = shift[i] / sd[i];
                largest[i] = largest[i].max(by.abs());
                bias[i] += by / compared.errors.len() as f64;
            }
            for e in error.iter().flat_map(|e| e.iter()) {
                max_field = max_field.max(e.abs());
                sum += e * e;
                count += 1.0;
            }
        }
        let own: Vec<&[f64]> = compared.chosen.iter().map(|&k| &points[k][..d]).collect();
        let weighed = weigh(&own, &compared.logs);
        debug_assert!(weighed.effective <= 1.0 + 1e-9);
        Ok(Self {
            draws: compared.chosen.len(),
            shift_sd: names.iter().cloned().zip(largest).collect(),
            bias_sd: bias,
            moments: reweighted(names, &own, &compared.logs),
            log_weights: compared.logs,
            max_field_nm: max_field * NM_PER_MM,
            rms_field_nm: (sum / count.max(1.0)).sqrt() * NM_PER_MM,
        })
    }
}

fn reweighted(names: &[String], draws: &[&[f64]], log_weights: &[f64]) -> Vec<Reweighted> {
    let moments = |weights: &[f64], k: usize| {
        let values = || draws.iter().zip(weights).map(|(x, w)| (x[k], w));
        let mean: f64 = values().map(|(x, w)| w * x).sum();
        let variance: f64 = values().map(|(x, w)| w * (x - mean).powi(2)).sum();
        [mean, variance.sqrt()]
    };
    let equal = shares(&vec![0.0; draws.len()]);
    let weights = shares(log_weights);
    let reweighted = |(k, name): (usize, &String)| Reweighted {
        name: name.clone(),
        plain: moments(&equal, k),
        weighted: moments(&weights, k),
    };
    names.iter().enumerate().map(reweighted).collect()
}

/// Covariance of the first `d` parameters of the draws.
fn covariance(draws: &Draws, d: usize) -> DMatrix<f64> {
    let n = draws.len() as f64;
    let mean = draws.points().fold(DVector::zeros(d), |m, x| {
        m + DVector::from_column_slice(&x[..d]) / n
    });
    let mut sum = DMatrix::zeros(d, d);
    for x in draws.points() {
        let r = DVector::from_column_slice(&x[..d]) - &mean;
        sum.ger(1.0 / n, &r, &r, 1.0);
    }
    sum
}

/// Gradient of the change of the log likelihood, by central differences over a tenth of a posterior sd.
fn gradient(posed: &Posed, x: &[f64], sd: &DVector<f64>, products: &DVector<f64>) -> DVector<f64> {
    const STEP: f64 = 0.1;
    let at = |k: usize, by: f64| {
        let mut moved = x.to_vec();
        moved[k] += by * sd[k];
        posed.change_with(&moved, products)
    };
    DVector::from_fn(sd.len(), |k, _| {
        (at(k, STEP) - at(k, -STEP)) / (2.0 * STEP * sd[k])
    })
}
