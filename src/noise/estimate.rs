//! The noise of a measured field at all of its points: what a residual is looked at with.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::normal::solve;
use super::reml::Hyperparameters;
use super::white::truncated_sd;
use super::{BlockCovariance, white};
use crate::error::Result;
use crate::field::{Blocks, Field};
use crate::quantity::NM_PER_MM;

/// Blocks over all points, and the covariance of their averages.
pub struct Noise {
    pub blocks: Blocks,
    /// Length, ratio and scale of each component's noise on them.
    pub at: [Hyperparameters; 2],
    /// Covariance of each component's block averages at unit scale.
    covariance: [Arc<BlockCovariance>; 2],
    /// White sd of a point from local differences, mm.
    pub white_mm: [f64; 2],
    /// Sd of a point, mm: its block's average and what it differs from that by.
    point_mm: [f64; 2],
    /// Effective number of independent points of both components.
    pub effective_points: f64,
}

/// Length, ratio and scale of a component's noise, and the covariance of block averages at unit scale.
pub type ComponentOfNoise = (Hyperparameters, Arc<BlockCovariance>);

impl Noise {
    /// The noise of both components on blocks of the same size over all points of a field, as `of` has it on some blocks; `modes` are those of
    /// u1, then of u2, mm at the points: local fits follow what they leave more easily than the field about a hole.
    ///
    /// # Errors
    /// Of the program, if a covariance is not positive definite.
    pub fn over(
        field: &Field,
        modes: &[Vec<[f64; 2]>],
        of: impl Fn(&Blocks) -> Result<[ComponentOfNoise; 2]>,
    ) -> Result<Self> {
        let blocks = Blocks::new(field, Blocks::size_for(field), |_| true);
        let [(first, of_first), (second, of_second)] = of(&blocks)?;
        let (at, covariance) = ([first, second], [of_first, of_second]);
        let left = Field {
            displacement: residual_of_fit(field, modes),
            ..field.clone()
        };
        let point = |c: usize| {
            let average = at[c].scale2 * covariance[c].mean_variance();
            (average + within_blocks(&left, &blocks, c)).sqrt()
        };
        Ok(Self {
            white_mm: white(&left).sd_mm,
            point_mm: [0, 1].map(point),
            effective_points: covariance.iter().map(|c| c.effective_points()).sum(),
            covariance,
            at,
            blocks,
        })
    }

    /// Sd of what is not correlated over blocks of a point, mm.
    pub fn white_sd(&self, c: usize) -> f64 {
        let white = self.point_mm[c].powi(2) - self.correlated_sd(c).powi(2);
        white.max(0.0).sqrt()
    }

    /// Sd of the correlated part of a point, mm.
    pub fn correlated_sd(&self, c: usize) -> f64 {
        (self.at[c].scale2 * self.at[c].ratio).sqrt()
    }

    /// Sd of a point's noise in nm.
    pub fn point_sd_nm(&self, c: usize) -> f64 {
        self.point_mm[c] * NM_PER_MM
    }

    /// Root mean square of the point sd over both components, nm.
    pub fn reference_nm(&self) -> f64 {
        (0.5 * (self.point_sd_nm(0).powi(2) + self.point_sd_nm(1).powi(2))).sqrt()
    }

    /// Whitened block averages of one component of some columns.
    pub fn whiten(&self, columns: &DMatrix<f64>, c: usize) -> DMatrix<f64> {
        self.covariance[c].whiten(columns) / self.at[c].scale2.sqrt()
    }
}

/// Variance of the points of one component about their blocks' averages, mm^2, whatever they are correlated by; outliers do not count.
fn within_blocks(field: &Field, blocks: &Blocks, c: usize) -> f64 {
    let values = field.component(c);
    let averages = blocks.average(&values);
    let of_points = values.iter().zip(&blocks.of_point);
    let scaled: Vec<f64> = of_points
        .filter_map(|(value, block)| Some((value, (*block)? as usize)))
        .filter(|&(_, block)| blocks.count[block] > 1)
        .map(|(value, block)| {
            let n = blocks.count[block] as f64;
            (value - averages[block]) * (n / (n - 1.0)).sqrt()
        })
        .collect();
    let shares: f64 = blocks.count.iter().map(|&n| (n - 1) as f64).sum();
    let points: f64 = blocks.count.iter().map(|&n| n as f64).sum();
    if scaled.is_empty() {
        return 0.0;
    }
    truncated_sd(&scaled).powi(2) * shares / points
}

/// Residual (mm) of each component's least-squares fit on its own modes and {1, s, t}; `modes` are those of u1, then of u2.
pub fn residual_of_fit(field: &Field, modes: &[Vec<[f64; 2]>]) -> Vec<[f64; 2]> {
    let mut residual = field.displacement.clone();
    let half = modes.len() / 2;
    for c in 0..2 {
        let basis = |i: usize| {
            let p = field.points[i];
            let own = modes[c * half..(c + 1) * half].iter().map(move |m| m[i][c]);
            own.chain([1.0, p[0], p[1]])
        };
        let p = half + 3;
        let mut gram = DMatrix::<f64>::zeros(p, p);
        let mut right = DVector::<f64>::zeros(p);
        for i in 0..field.len() {
            let row = DVector::from_iterator(p, basis(i));
            right.axpy(field.displacement[i][c], &row, 1.0);
            gram.ger(1.0, &row, &row, 1.0);
        }
        let fit = solve(&gram, &right);
        for (i, r) in residual.iter_mut().enumerate() {
            r[c] -= basis(i).zip(fit.iter()).map(|(b, f)| b * f).sum::<f64>();
        }
    }
    residual
}
