//! The constants with and without some blocks, about the same account: what a mask would do to them.

use nalgebra::{DMatrix, DVector};

use crate::dense::{product, tr_product};
use crate::laminate::MeanSd;
use crate::linearise::{Column, Sensitivities};
use crate::noise::NormalEquations;
use crate::noise::series::FrameNoise;

/// An account of a series: the columns that take part and the noise, in which blocks can be left out.
pub struct Account<'a> {
    pub sensitivities: &'a Sensitivities,
    /// The columns that take part, among all.
    pub own: &'a [usize],
    /// Of u1 and u2: those columns and, last, the data, (frames n) x (p + 1).
    pub columns: [&'a DMatrix<f64>; 2],
    pub noise: &'a FrameNoise,
    pub reference: f64,
}

impl Account<'_> {
    /// Mean and sd of every constant without the blocks that are `left_out`, border units.
    pub fn constants(&self, left_out: &[usize]) -> Option<Vec<MeanSd>> {
        let p = self.own.len();
        let inverse: Vec<f64> = self.noise.scales.iter().map(|d| d.recip()).collect();
        let total: f64 = inverse.iter().sum();
        let share = self.reference / (1.0 + self.reference * total);
        let mut all = DMatrix::zeros(p + 1, p + 1);
        for (c, columns) in self.columns.iter().enumerate() {
            let precision = self.precision(c, left_out)?;
            let n = precision.nrows();
            let mut sum = DMatrix::zeros(n, p + 1);
            for (t, weight) in inverse.iter().enumerate() {
                let frame = columns.rows(t * n, n).into_owned();
                all += *weight * tr_product(&frame, &product(&precision, &frame));
                sum += *weight * frame;
            }
            all -= share * tr_product(&sum, &product(&precision, &sum));
        }
        let mut inside = all.view((0, 0), (p, p)).into_owned();
        let mut right: DVector<f64> = all.view((0, p), (p, 1)).column(0).into_owned();
        self.sensitivities.add_known(&mut inside, &mut right);
        let fit = NormalEquations::with_unit_prior(inside, right)?;
        let (mean, covariance) = (fit.mean(), fit.covariance());
        let constants = self.sensitivities.base[..self.sensitivities.constants].iter();
        let one = |(k, column): (usize, &Column)| MeanSd {
            mean: column.mean + column.sd * mean[k],
            sd: column.sd * covariance[(k, k)].sqrt(),
        };
        Some(constants.enumerate().map(one).collect())
    }

    /// Precision of one frame's blocks without some of them, which have zeros there: the inverse of the covariance of the others.
    fn precision(&self, c: usize, left_out: &[usize]) -> Option<DMatrix<f64>> {
        let spatial = &self.noise.spatial[c];
        let all = spatial.covariance.inverse() / spatial.scale2;
        if left_out.is_empty() {
            return Some(all);
        }
        let across = all.select_columns(left_out);
        let inside = across.select_rows(left_out).cholesky()?;
        Some(&all - &across * inside.solve(&across.transpose()))
    }
}
