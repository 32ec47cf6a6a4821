//! What the fitted model leaves unexplained.

use nalgebra::{DMatrix, DVector};

use super::inverse::InverseProblem;
use crate::infer::{Observation, Statistics, UnitColumns};
use crate::noise::Noise;
use crate::numeric::add_scaled;
use crate::quantity::NM_PER_MM;

/// The residual field and its size.
#[derive(Debug, Clone)]
pub struct Residual {
    /// Measured minus predicted (u1, u2) at every point, mm.
    pub field: Vec<[f64; 2]>,
    /// Root mean square of each component, nm.
    pub rms_nm: [f64; 2],
    /// Noise sd of each component, nm, independent of the model.
    pub noise_nm: [f64; 2],
    /// chi^2 of the block averages by their covariance, per degree of freedom.
    pub chi2_reduced: f64,
    /// Probability of a larger one, the uncertainty of the noise's size counted.
    pub p_chi2: f64,
    /// Share of the residual's variance that is not noise.
    pub structured_fraction: f64,
    pub points: usize,
    /// Effective number of independent values (both components), given the noise's correlation.
    pub effective_points: f64,
}

impl Residual {
    /// What the expected coefficients and amplitudes leave at a point of the posterior's parameters.
    pub fn at(inverse: &InverseProblem, parameters: &[f64]) -> Self {
        let posterior = &inverse.posterior;
        let theta = &parameters[..posterior.structural()];
        let scale = posterior.scale(parameters);
        let alpha = posterior.likelihood().expected(theta, scale);
        let statistics = &inverse.statistics;
        let beta = &statistics.effect_offset - &statistics.effect_slope * &alpha;
        Self::new(
            &inverse.prepared.observation,
            &inverse.columns,
            &inverse.noise,
            statistics,
            &alpha,
            &beta,
        )
    }

    /// Residual of a prediction with POD coefficients `alpha` (mm) and effect amplitudes `beta` (border units).
    pub fn new(
        observation: &Observation,
        columns: &UnitColumns,
        noise: &Noise,
        statistics: &Statistics,
        alpha: &DVector<f64>,
        beta: &DVector<f64>,
    ) -> Self {
        let mut field = observation.field.displacement.clone();
        let amplitudes = alpha.iter().chain(beta.iter());
        for (column, &a) in columns.modes.iter().chain(&columns.effects).zip(amplitudes) {
            add_scaled(&mut field, column, -a);
        }
        let n = field.len() as f64;
        let square = |c: usize| field.iter().map(|r| r[c] * r[c]).sum::<f64>() / n;
        let rms_nm = [0, 1].map(|c| square(c).sqrt() * NM_PER_MM);
        let noise_nm = [0, 1].map(|c| noise.point_sd_nm(c));
        let total: f64 = rms_nm.iter().map(|v| v * v).sum();
        let random: f64 = noise_nm.iter().map(|v| v * v).sum();
        let chi2_reduced = statistics.reduced_chi2(alpha);
        let scale = 0.25 * (noise.log_variance[0].1 + noise.log_variance[1].1);
        let error = (1.0 / noise.blocks.len() as f64 + scale).sqrt();
        let z = (chi2_reduced - 1.0) / error;
        Self {
            rms_nm,
            noise_nm,
            chi2_reduced,
            p_chi2: 0.5 * statrs::function::erf::erfc(z / std::f64::consts::SQRT_2),
            structured_fraction: (1.0 - random / total).max(0.0),
            points: field.len(),
            effective_points: noise.effective_points,
            field,
        }
    }

    /// Root mean square of both components together, nm.
    pub fn rms_all_nm(&self) -> f64 {
        (0.5 * (self.rms_nm[0].powi(2) + self.rms_nm[1].powi(2))).sqrt()
    }
}

/// Mean and covariance of the effects' amplitudes over posterior draws of the coefficients.
pub fn effect_amplitudes(
    statistics: &Statistics,
    alphas: &[(DVector<f64>, DMatrix<f64>, f64)],
) -> (DVector<f64>, DMatrix<f64>) {
    let q = statistics.effect_offset.len();
    let n = alphas.len() as f64;
    let given = |alpha: &DVector<f64>| &statistics.effect_offset - &statistics.effect_slope * alpha;
    let mean = alphas
        .iter()
        .fold(DVector::zeros(q), |m, (alpha, ..)| m + given(alpha) / n);
    let mut covariance = DMatrix::zeros(q, q);
    for (alpha, spread, scale) in alphas {
        let d = given(alpha) - &mean;
        covariance += (&d * d.transpose()
            + &statistics.effect_slope * spread * statistics.effect_slope.transpose()
            + &statistics.effect_covariance * (scale * scale))
            / n;
    }
    (mean, covariance)
}
