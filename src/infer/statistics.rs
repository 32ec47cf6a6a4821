//! Sufficient statistics: all that the measured field says about the coefficients, whatever its number of points.

use nalgebra::{DMatrix, DVector};

use super::linear::{invert, solve};
use super::noise::{Noise, component};
use super::observation::{Columns, Observation};
use crate::error::Result;

/// Generalised least squares of the block averages on modes and declared effects, at the estimated noise scale.
#[derive(Debug, Clone)]
pub struct Statistics {
    /// Precision of the POD coefficients with the effects marginalised, 1/mm^2, p x p.
    pub precision: DMatrix<f64>,
    /// Precision times the estimate of the coefficients, 1/mm.
    pub weighted: DVector<f64>,
    /// Amplitudes of the effects given coefficients alpha: `offset - slope alpha`, border units.
    pub effect_offset: DVector<f64>,
    /// See `effect_offset`.
    pub effect_slope: DMatrix<f64>,
    /// Covariance of the effects' amplitudes given the coefficients.
    pub effect_covariance: DMatrix<f64>,
    /// Residual sum of squares at the least-squares coefficients, noise scale 1.
    pub residual: f64,
    /// Number of block averages of both components.
    pub count: usize,
    /// Contrasts from which the noise scale is known.
    pub contrasts: usize,
}

impl Statistics {
    /// Reduce an observation.
    pub fn new(observation: &Observation, columns: &Columns, noise: &Noise) -> Result<Self> {
        let (p, q) = (columns.modes.len(), columns.effects.len());
        let mut gram = DMatrix::zeros(p + q, p + q);
        let mut weighted = DVector::zeros(p + q);
        let mut total = 0.0;
        for c in 0..2 {
            let x = component(
                columns.modes.iter().chain(&columns.effects),
                c,
                &noise.blocks,
            );
            let x = noise.whiten(&x, c);
            let y = noise.blocks.average(&observation.field.component(c));
            let y = noise
                .whiten(&DMatrix::from_column_slice(y.len(), 1, y.as_slice()), c)
                .column(0)
                .into_owned();
            gram += x.tr_mul(&x);
            weighted += x.tr_mul(&y);
            total += y.norm_squared();
        }
        let prior = DVector::from_iterator(
            q,
            columns
                .plausible
                .iter()
                .map(|s| s.map_or(0.0, |s| 1.0 / (s * s))),
        );
        let mut bb = gram.view((p, p), (q, q)).into_owned();
        for k in 0..q {
            bb[(k, k)] += prior[k];
        }
        let inverse = invert(bb)?;
        let ba = gram.view((p, 0), (q, p)).into_owned();
        let slope = &inverse * &ba;
        let offset = &inverse * weighted.rows(p, q);
        let precision = gram.view((0, 0), (p, p)) - ba.tr_mul(&slope);
        let b = weighted.rows(0, p) - ba.tr_mul(&offset);
        let residual = total - weighted.rows(p, q).dot(&offset) - b.dot(&solve(&precision, &b));
        Ok(Self {
            precision: 0.5 * (&precision + precision.transpose()),
            weighted: b,
            effect_offset: offset,
            effect_slope: slope,
            effect_covariance: inverse,
            residual,
            count: 2 * noise.blocks.len(),
            contrasts: noise.contrasts(),
        })
    }

    /// Least-squares estimate of the coefficients, mm.
    pub fn estimate(&self) -> DVector<f64> {
        solve(&self.precision, &self.weighted)
    }

    /// Reduced chi^2 of a prediction with coefficients `alpha` (the effects at their best given it).
    pub fn reduced_chi2(&self, alpha: &DVector<f64>) -> f64 {
        let d = alpha - self.estimate();
        let fitted = self.precision.nrows() + self.effect_offset.len();
        let chi2 = self.residual + d.dot(&(&self.precision * &d));
        chi2 / (self.count - fitted) as f64
    }
}
