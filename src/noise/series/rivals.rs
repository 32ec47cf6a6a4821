//! The rivals of every named effect: a smooth discrepancy of the model that is the same in all frames, or grows with the load.
//!
//! With values whitened by N (s2 N = L L') and by Phi, a rival delta s2 w w' (x) M changes one direction of frames only, Phi^-1/2 w,
//! of length sqrt(alpha), alpha = w' Phi^-1 w; there the covariance is I + delta alpha L^-1 M L^-T, diagonal in that matrix's
//! eigenvectors for every delta and every reference's share.

use nalgebra::{DMatrix, DVector};

use super::frames::Growth;
use crate::dense::{eigen, gram, tr_product};
use crate::error::Result;
use crate::field::Blocks;
use crate::noise::{BlockCovariance, Matern};

/// Lengths of rivals over the window's shorter side.
pub(super) const LENGTHS: [f64; 3] = [0.12, 0.3, 0.7];

/// Ratios delta of a rival's variance to s2.
pub(super) const RATIOS: [f64; 8] = [0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];

/// Eigenvectors in which a rival adds less than this part to the noise are left out of it.
const NEGLIGIBLE: f64 = 1e-9;

/// A smooth discrepancy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rival {
    /// How it goes over the frames.
    pub law: Growth,
    /// Correlation length, mm.
    pub length_mm: f64,
    /// Ratio delta of its variance to s2, in a frame of load 1.
    pub ratio: f64,
}

/// The eigenvectors of rivals of one length, whitened by one noise.
#[derive(Debug)]
pub(super) struct RivalModes {
    /// Decreasing.
    values: DVector<f64>,
    vectors: DMatrix<f64>,
}

impl RivalModes {
    /// Under the noise `covariance` at s = 1.
    ///
    /// # Errors
    /// Of the program: an eigendecomposition that fails.
    pub fn new(blocks: &Blocks, length_mm: f64, covariance: &BlockCovariance) -> Result<Self> {
        let half = covariance.whiten(&Matern::new(blocks, length_mm).correlation);
        let (values, vectors) = eigen(&covariance.whiten(&half.transpose()))?;
        let kept = values.iter().rev().take_while(|&&v| v > 0.0).count();
        let order: Vec<usize> = (0..kept).map(|k| values.len() - 1 - k).collect();
        Ok(Self {
            values: DVector::from_iterator(kept, order.iter().map(|&k| values[k])),
            vectors: vectors.select_columns(&order),
        })
    }

    /// Whitened columns (blocks x p) in the eigenvectors: eigenvectors x p.
    pub fn rotate(&self, white: &DMatrix<f64>) -> DMatrix<f64> {
        tr_product(&self.vectors, white)
    }

    /// How many eigenvectors a rival of the variance `size` = delta alpha uses.
    fn count(&self, size: f64) -> usize {
        self.values
            .iter()
            .take_while(|&&v| size * v > NEGLIGIBLE)
            .count()
    }

    /// What the rival adds to log det of the covariance.
    pub fn log_det(&self, size: f64) -> f64 {
        let used = self.values.iter().take(self.count(size));
        used.map(|v| (size * v).ln_1p()).sum()
    }

    /// What it takes from X' C^-1 X, for columns `rotated` along its direction of frames: common + by * loaded of each.
    pub fn explained(
        &self,
        size: f64,
        [common, loaded]: [&DMatrix<f64>; 2],
        by: [f64; 2],
    ) -> DMatrix<f64> {
        let used = self.count(size);
        let roots: Vec<f64> = self
            .values
            .iter()
            .take(used)
            .map(|v| (size * v / (1.0 + size * v)).sqrt())
            .collect();
        let scaled = DMatrix::from_fn(used, common.ncols(), |k, j| {
            roots[k] * (by[0] * common[(k, j)] + by[1] * loaded[(k, j)])
        });
        gram(&scaled)
    }
}
