//! Prediction of parts of the field that were not fitted: squares of several correlation lengths, in four folds.

use nalgebra::{DMatrix, DVector};

use super::sensitivities::{Column, Measured, Sensitivities};
use super::subsets::{Subset, columns};
use crate::noise::{Hyperparameters, NormalEquations};
use crate::quantity::NM_PER_MM;

/// Side of the squares that are held out, mm; more than the correlation length of any noise. It is a weak test: among fitted
/// neighbours, 19 of 20 wrong groups predicted such squares too (measured on the program as built).
const SQUARE_MM: f64 = 3.0;

pub const FOLDS: usize = 4;

/// Blocks of each fold, and the variance of every block average.
pub struct Holdout<'a> {
    sensitivities: &'a Sensitivities,
    ranges: &'a [Vec<usize>],
    fold: Vec<usize>,
    variance: [DVector<f64>; 2],
    residual: [DVector<f64>; 2],
}

/// Error of held-out blocks, by fold: sum over variance, sum of squares (mm^2), number of values.
pub type Errors = [(f64, f64, usize); FOLDS];

impl<'a> Holdout<'a> {
    /// Lay the squares; variances from the hyperparameters of each component.
    pub fn new(
        measured: &Measured,
        sensitivities: &'a Sensitivities,
        ranges: &'a [Vec<usize>],
        at: [&Hyperparameters; 2],
    ) -> Self {
        let blocks = &measured.blocks;
        // at least three blocks a side, whatever their size
        let side = SQUARE_MM.max(3.0 * blocks.size_mm);
        let fold = blocks
            .centroid
            .iter()
            .map(|c| {
                let [i, j] = c.map(|x| (x / side).floor() as i64);
                (i + 2 * j).rem_euclid(FOLDS as i64) as usize
            })
            .collect();
        let mean = blocks.mean_count();
        let variance = at.map(|s| {
            DVector::from_iterator(
                blocks.len(),
                blocks
                    .count
                    .iter()
                    .map(|&n| s.scale2 * (mean / n as f64 + s.ratio)),
            )
        });
        Self {
            sensitivities,
            ranges,
            fold,
            variance,
            residual: measured.residual(sensitivities),
        }
    }

    /// Prediction errors of every fold by a model with a subset of the candidates, fitted to the other folds.
    pub fn errors(&self, subset: &Subset) -> Errors {
        let all: Vec<&Column> = self
            .sensitivities
            .candidates
            .iter()
            .flat_map(|c| &c.columns)
            .collect();
        let chosen = columns(self.ranges, subset);
        let fitted: Vec<&Column> = self
            .sensitivities
            .base
            .iter()
            .chain(chosen.iter().map(|&k| all[k]))
            .collect();
        let (total, by_fold) = self.normal(&fitted);
        let mut errors = [(0.0, 0.0, 0); FOLDS];
        for (f, error) in errors.iter_mut().enumerate() {
            let (gram, right) = (&total.0 - &by_fold[f].0, &total.1 - &by_fold[f].1);
            let Some(fit) = NormalEquations::with_unit_prior(gram, right) else {
                continue;
            };
            let x = fit.mean();
            for c in 0..2 {
                for b in (0..self.fold.len()).filter(|&b| self.fold[b] == f) {
                    let predicted: f64 = fitted
                        .iter()
                        .zip(x.iter())
                        .map(|(col, x)| col.values[c][b] * x)
                        .sum();
                    let r = self.residual[c][b] - predicted;
                    error.0 += r * r / self.variance[c][b];
                    error.1 += r * r;
                    error.2 += 1;
                }
            }
        }
        errors
    }

    /// Normal equations of all blocks, and of each fold alone.
    #[allow(clippy::type_complexity)]
    fn normal(
        &self,
        fitted: &[&Column],
    ) -> (
        (DMatrix<f64>, DVector<f64>),
        Vec<(DMatrix<f64>, DVector<f64>)>,
    ) {
        let p = fitted.len();
        let zero = || (DMatrix::<f64>::zeros(p, p), DVector::<f64>::zeros(p));
        let mut by_fold: Vec<_> = (0..FOLDS).map(|_| zero()).collect();
        let mut row = DVector::zeros(p);
        for c in 0..2 {
            for b in 0..self.fold.len() {
                for (x, column) in row.iter_mut().zip(fitted) {
                    *x = column.values[c][b];
                }
                let (gram, right) = &mut by_fold[self.fold[b]];
                let weight = 1.0 / self.variance[c][b];
                gram.ger(weight, &row, &row, 1.0);
                right.axpy(weight * self.residual[c][b], &row, 1.0);
            }
        }
        let total = by_fold.iter().fold(zero(), |a, b| (a.0 + &b.0, a.1 + &b.1));
        (total, by_fold)
    }
}

/// Root mean square error of the held-out block averages, nm.
pub fn rms_nm(errors: &Errors) -> f64 {
    let (sum, count) = errors.iter().fold((0.0, 0), |(s, n), e| (s + e.1, n + e.2));
    (sum / count.max(1) as f64).sqrt() * NM_PER_MM
}

/// Whether `with` predicts better than `without`: in total, and in at least three folds of four.
pub fn gains(with: &Errors, without: &Errors) -> bool {
    let total = |e: &Errors| e.iter().map(|f| f.0).sum::<f64>();
    let better = with.iter().zip(without).filter(|(a, b)| a.0 < b.0).count();
    total(with) < total(without) && better + 1 >= FOLDS
}
