//! The covariance family of one frame's noise: N = s^2 (K + rho M(l)) on blocks, M of one of two kernels.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use serde::{Deserialize, Serialize};

use super::frames::Frames;
use super::subset_kernel::subset_covariance;
use crate::error::Result;
use crate::field::Blocks;
use crate::noise::covariance::{discrepancy_lengths_mm, noise_lengths_mm};
use crate::noise::{BlockCovariance, Matern};

/// Lengths of smooth patterns over the shorter side of the window: 2, 4, 8 and 16 mm in 24 mm. Real patterns (lighting, warm air, the
/// camera's own warmth) reach over a third of it.
const LENGTHS: [f64; 4] = [1.0 / 12.0, 1.0 / 6.0, 1.0 / 3.0, 2.0 / 3.0];

/// Without a declared subset, noise may be correlated over less as well.
const SHORTEST: f64 = 1.0 / 24.0;

/// Ratios rho that are tabulated; the best is refined.
pub(super) const RATIOS: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

/// Part of the noise that no subset correlates: what interpolation and rounding add, relative to the mean block's variance. Blocks
/// smaller than a subset have fine patterns in which overlapping subsets leave next to nothing; there a part of 2 % where there is
/// none made s2 18 % too small (tests/unit/series_noise.rs). None at all would trust the model's own errors of that size.
pub(super) const NUGGETS: [f64; 6] = [0.02, 0.001, 0.003, 0.01, 0.05, 0.2];

/// The family of one series.
pub(super) struct ShapeFamily<'a> {
    pub blocks: &'a Blocks,
    /// K without its nugget, and the nugget of size 1; without a subset no K, and the nugget is all.
    subset: Option<DMatrix<f64>>,
    own: DVector<f64>,
    /// Correlation lengths that are tabulated, mm.
    pub lengths_mm: Vec<f64>,
    /// Lengths of the search end here, mm.
    pub range_mm: [f64; 2],
    /// Correlation from this length on is a discrepancy.
    discrepancy_mm: f64,
}

/// How the correlation of smooth patterns falls with the distance d.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SmoothKernel {
    /// Matern-3/2: patterns with a slope and no curvature.
    Matern,
    /// exp(-d^2 / 2 l^2): patterns with all derivatives, as warm air leaves them.
    SquaredExponential,
}

impl SmoothKernel {
    /// Averaged over blocks.
    pub(super) fn correlation(self, blocks: &Blocks, length_mm: f64) -> Matern {
        match self {
            Self::Matern => Matern::new(blocks, length_mm),
            Self::SquaredExponential => Matern::squared_exponential(blocks, length_mm),
        }
    }
}

/// Covariance hyperparameters of one frame's noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CorrelationShape {
    /// How the correlation of smooth patterns falls; with `length_mm` of no meaning where `ratio` is 0.
    pub kernel: SmoothKernel,
    /// Correlation length l of smooth patterns, mm.
    pub length_mm: f64,
    /// Ratio rho of their variance to that of a point (with a subset) or of a block (without).
    pub ratio: f64,
    /// Part of a block's noise that no subset correlates; of no meaning without a subset.
    pub nugget: f64,
}

impl<'a> ShapeFamily<'a> {
    /// Of frames whose noise contrasts know (`any_length`), or of one field, in which long correlation is a discrepancy.
    pub fn new(frames: &Frames<'a>, any_length: bool) -> Self {
        let blocks = frames.blocks;
        let subset = frames.subset_mm.map(|w| subset_covariance(blocks, w));
        let typical = subset.as_ref().map_or(1.0, |k| k.diagonal().mean());
        let shares = blocks
            .count
            .iter()
            .map(|n| typical * blocks.mean_count() / *n as f64);
        let side = frames.window_mm();
        let lengths_mm: Vec<f64> = if any_length {
            let shortest = frames.subset_mm.is_none().then_some(SHORTEST);
            let shares = shortest.into_iter().chain(LENGTHS);
            shares.map(|share| share * side).collect()
        } else {
            [noise_lengths_mm(blocks), discrepancy_lengths_mm(blocks)].concat()
        };
        let ends = [lengths_mm[0], lengths_mm[lengths_mm.len() - 1]];
        let discrepancy_mm = if any_length {
            f64::INFINITY
        } else {
            discrepancy_lengths_mm(blocks)[0]
        };
        Self {
            blocks,
            own: DVector::from_iterator(blocks.len(), shares),
            subset,
            range_mm: [ends[0] / 2_f64.sqrt(), ends[1]],
            lengths_mm,
            discrepancy_mm,
        }
    }

    /// Whether a shape describes a discrepancy of the model rather than noise.
    pub fn is_discrepancy(&self, shape: CorrelationShape) -> bool {
        shape.ratio > 0.0 && shape.length_mm >= self.discrepancy_mm
    }

    /// Nuggets to choose from, the one to begin with first.
    pub fn nuggets(&self) -> &'static [f64] {
        if self.subset.is_some() {
            &NUGGETS
        } else {
            &NUGGETS[..1]
        }
    }

    /// Noise without smooth patterns.
    pub fn white(&self) -> CorrelationShape {
        CorrelationShape {
            kernel: SmoothKernel::Matern,
            length_mm: self.lengths_mm[0],
            ratio: 0.0,
            nugget: self.nuggets()[0],
        }
    }

    /// The covariance at s = 1 of a shape whose correlation is `smooth`.
    ///
    /// # Errors
    /// Of the program, if it is not positive definite.
    pub fn with(
        &self,
        smooth: Option<&Matern>,
        shape: CorrelationShape,
    ) -> Result<BlockCovariance> {
        let parts: Vec<_> = smooth.map(|m| (m, shape.ratio)).into_iter().collect();
        // a point has the nugget of its block many times
        let count = self.blocks.mean_count();
        match &self.subset {
            Some(subset) => {
                let mut white = subset.clone();
                for (b, own) in self.own.iter().enumerate() {
                    white[(b, b)] += shape.nugget * own;
                }
                let nugget = shape.nugget * subset.diagonal().mean();
                BlockCovariance::over(&white, 1.0 + nugget * count, &parts)
            }
            None => BlockCovariance::over(&DMatrix::from_diagonal(&self.own), count, &parts),
        }
    }

    /// The covariance at s = 1.
    ///
    /// # Errors
    /// Of the program, if it is not positive definite.
    pub fn at(&self, shape: CorrelationShape) -> Result<BlockCovariance> {
        if shape.ratio == 0.0 {
            return self.with(None, shape);
        }
        let smooth = shape.kernel.correlation(self.blocks, shape.length_mm);
        self.with(Some(&smooth), shape)
    }

    /// Those of u1 and u2; where they have one shape, one for both.
    ///
    /// # Errors
    /// Those of [`ShapeFamily::at`].
    pub fn of_both(&self, shapes: [CorrelationShape; 2]) -> Result<[Arc<BlockCovariance>; 2]> {
        let first = Arc::new(self.at(shapes[0])?);
        let second = if shapes[0] == shapes[1] {
            Arc::clone(&first)
        } else {
            Arc::new(self.at(shapes[1])?)
        };
        Ok([first, second])
    }
}
