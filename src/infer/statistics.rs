//! Sufficient statistics: all that the measured field says about the coefficients, whatever its number of points.

use nalgebra::{DMatrix, DVector};

use super::observation::{Observation, UnitColumns};
use crate::error::{Error, Result};
use crate::noise::{Noise, NormalEquations, component, solve};

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
    /// Degrees of freedom from which the noise scale is known.
    pub freedom: f64,
}

impl Statistics {
    /// Reduce an observation.
    pub fn new(observation: &Observation, columns: &UnitColumns, noise: &Noise) -> Result<Self> {
        let (p, q) = (columns.modes.len(), columns.effects.len());
        let whitened = Whitened::new(columns, noise);
        let mut gram = DMatrix::zeros(p + q, p + q);
        for x in &whitened.columns {
            gram += x.tr_mul(x);
        }
        let (mut weighted, mut total) = whitened.project(noise, &observation.field.displacement);
        let prior = DVector::from_iterator(
            q,
            columns
                .prior_sd
                .iter()
                .map(|s| s.map_or(0.0, |s| 1.0 / (s * s))),
        );
        let mut bb = gram.view((p, p), (q, q)).into_owned();
        for k in 0..q {
            bb[(k, k)] += prior[k];
            weighted[p + k] += prior[k] * columns.prior_mean[k];
            total += prior[k] * columns.prior_mean[k].powi(2);
        }
        let effects =
            NormalEquations::new(bb, weighted.rows(p, q).into_owned()).ok_or_else(|| {
                Error::input(
                    "effects",
                    "declared effects that differ on the measured points",
                )
                .found("effects whose columns depend on each other")
                .hint("declare only one of them")
            })?;
        let ba = gram.view((p, 0), (q, p)).into_owned();
        let slope = effects.solve(&ba);
        let offset = effects.mean();
        let precision = gram.view((0, 0), (p, p)) - ba.tr_mul(&slope);
        let b = weighted.rows(0, p) - ba.tr_mul(&offset);
        let residual = total - weighted.rows(p, q).dot(&offset) - b.dot(&solve(&precision, &b));
        Ok(Self {
            precision: 0.5 * (&precision + precision.transpose()),
            weighted: b,
            effect_offset: offset,
            effect_slope: slope,
            effect_covariance: effects.covariance(),
            residual,
            count: 2 * noise.blocks.len(),
            freedom: noise.freedom(),
        })
    }

    /// What a field at the measured points adds to `weighted`, with the effects marginalised, 1/mm.
    pub fn weighted_of(
        &self,
        whitened: &Whitened,
        noise: &Noise,
        field: &[[f64; 2]],
    ) -> DVector<f64> {
        let (all, _) = whitened.project(noise, field);
        self.without_effects(&all)
    }

    /// The same of block averages, mm.
    pub fn weighted_of_averages(
        &self,
        whitened: &Whitened,
        noise: &Noise,
        averages: &[DVector<f64>; 2],
    ) -> DVector<f64> {
        let (all, _) = whitened.project_averages(noise, averages);
        self.without_effects(&all)
    }

    /// Products with modes, the effects marginalised, from those with all columns.
    fn without_effects(&self, all: &DVector<f64>) -> DVector<f64> {
        let (p, q) = (self.weighted.len(), self.effect_offset.len());
        all.rows(0, p) - self.effect_slope.tr_mul(&all.rows(p, q))
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

/// Block averages of all columns, modes then effects, whitened by the noise of each component.
pub struct Whitened {
    columns: [DMatrix<f64>; 2],
}

impl Whitened {
    /// Average and whiten.
    pub fn new(columns: &UnitColumns, noise: &Noise) -> Self {
        let all = || columns.modes.iter().chain(&columns.effects);
        Self {
            columns: [0, 1].map(|c| noise.whiten(&component(all(), c, &noise.blocks), c)),
        }
    }

    /// Scalar products of a field (mm at the measured points) with every column, and with itself.
    fn project(&self, noise: &Noise, field: &[[f64; 2]]) -> (DVector<f64>, f64) {
        let averages = [0, 1].map(|c| {
            let values: Vec<f64> = field.iter().map(|u| u[c]).collect();
            noise.blocks.average(&values)
        });
        self.project_averages(noise, &averages)
    }

    /// The same of block averages.
    fn project_averages(&self, noise: &Noise, averages: &[DVector<f64>; 2]) -> (DVector<f64>, f64) {
        let mut products = DVector::zeros(self.columns[0].ncols());
        let mut total = 0.0;
        for (c, (x, y)) in self.columns.iter().zip(averages).enumerate() {
            let y = noise.whiten(&DMatrix::from_column_slice(y.len(), 1, y.as_slice()), c);
            products += x.tr_mul(&y.column(0));
            total += y.norm_squared();
        }
        (products, total)
    }
}
