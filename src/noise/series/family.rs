//! The covariance family of one frame's noise: N = s^2 (K + rho Matern(l)) on blocks.

use nalgebra::{DMatrix, DVector};

use super::frames::Frames;
use super::subset_kernel::subset_covariance;
use crate::error::Result;
use crate::field::Blocks;
use crate::noise::covariance::noise_lengths_mm;
use crate::noise::{BlockCovariance, Matern};

/// Lengths of smooth patterns over the shorter side of the window: 2, 4, 8 and 16 mm in 24 mm. Real patterns (lighting, warm air, the
/// camera's own warmth) reach over a third of it.
const LENGTHS: [f64; 4] = [1.0 / 12.0, 1.0 / 6.0, 1.0 / 3.0, 2.0 / 3.0];

/// Without a declared subset, noise may be correlated over less as well.
const SHORTEST: f64 = 1.0 / 24.0;

/// Ratios rho that are tabulated; the best is refined.
pub(super) const RATIOS: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

/// Part of the noise that no subset correlates: what interpolation and rounding add, relative to the mean block's variance.
const NUGGET: f64 = 0.02;

/// The family of one series.
pub(super) struct Family<'a> {
    pub blocks: &'a Blocks,
    /// K, with its nugget.
    white: DMatrix<f64>,
    /// Variance of a point's white part at s = 1.
    point: f64,
    /// Correlation lengths that are tabulated, mm.
    pub lengths_mm: Vec<f64>,
    /// Lengths of the search end here, mm.
    pub range_mm: [f64; 2],
}

/// Covariance hyperparameters of one frame's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub length_mm: f64,
    pub ratio: f64,
}

impl<'a> Family<'a> {
    /// Of frames whose noise contrasts know (`any_length`), or of one field, in which long correlation is a discrepancy.
    pub fn new(frames: &Frames<'a>, any_length: bool) -> Self {
        let blocks = frames.blocks;
        let shares = blocks.mean_count();
        let shares = blocks.count.iter().map(|n| shares / *n as f64);
        let shares = DVector::from_iterator(blocks.len(), shares);
        let (white, point) = match frames.subset_mm {
            Some(subset_mm) => {
                let mut white = subset_covariance(blocks, subset_mm);
                let nugget = NUGGET * white.diagonal().mean();
                for (b, share) in shares.iter().enumerate() {
                    white[(b, b)] += nugget * share;
                }
                // a point has the nugget of its block many times
                (white, 1.0 + nugget * blocks.mean_count())
            }
            None => (DMatrix::from_diagonal(&shares), blocks.mean_count()),
        };
        let side = frames.window_mm();
        let lengths_mm: Vec<f64> = if any_length {
            let shortest = frames.subset_mm.is_none().then_some(SHORTEST);
            let shares = shortest.into_iter().chain(LENGTHS);
            shares.map(|share| share * side).collect()
        } else {
            noise_lengths_mm(blocks).to_vec()
        };
        let ends = [lengths_mm[0], lengths_mm[lengths_mm.len() - 1]];
        Self {
            blocks,
            white,
            point,
            range_mm: [ends[0] / 2_f64.sqrt(), ends[1]],
            lengths_mm,
        }
    }

    /// The covariance at s = 1 of a shape whose correlation is `matern`.
    ///
    /// # Errors
    /// Of the program, if it is not positive definite.
    pub fn with(&self, matern: &Matern, ratio: f64) -> Result<BlockCovariance> {
        BlockCovariance::over(&self.white, self.point, &[(matern, ratio)])
    }

    /// The covariance at s = 1.
    ///
    /// # Errors
    /// Of the program, if it is not positive definite.
    pub fn at(&self, shape: Shape) -> Result<BlockCovariance> {
        if shape.ratio == 0.0 {
            return BlockCovariance::over(&self.white, self.point, &[]);
        }
        self.with(&Matern::new(self.blocks, shape.length_mm), shape.ratio)
    }
}
