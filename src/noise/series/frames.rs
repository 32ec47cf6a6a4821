//! A series as its noise sees it.

use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::field::{Blocks, bounds};

/// The frames of a series: the same blocks under several loads.
#[derive(Debug, Clone)]
pub struct Frames<'a> {
    /// The blocks, the same in every frame.
    pub blocks: &'a Blocks,
    /// Force over the largest force of each frame, as far as it is known; zero for an unloaded one.
    pub loads: Vec<f64>,
    /// Side of the correlation subset, mm, where it is declared.
    pub subset_mm: Option<f64>,
}

/// How something unknown goes over the frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Growth {
    /// The same in all frames.
    Constant,
    /// In proportion to the load.
    WithLoad,
}

/// Loads that vary by less than this part of their size are equal.
const EQUAL: f64 = 1e-6;

impl Frames<'_> {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.loads.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.loads.is_empty()
    }

    /// Shorter side of the window, mm.
    pub fn window_mm(&self) -> f64 {
        let [low, high] = bounds(&self.blocks.centroid);
        (high[0] - low[0]).min(high[1] - low[1]) + self.blocks.size_mm
    }

    /// The laws that the loads can tell apart: one where all frames have the same load.
    pub fn laws(&self) -> Vec<Growth> {
        let f = self.direction(Growth::WithLoad);
        let varies = (&f - DVector::repeat(f.len(), f.mean())).norm() > EQUAL * f.norm();
        if varies {
            vec![Growth::Constant, Growth::WithLoad]
        } else {
            vec![Growth::Constant]
        }
    }

    /// What follows a law, frame by frame.
    pub fn direction(&self, law: Growth) -> DVector<f64> {
        match law {
            Growth::Constant => DVector::repeat(self.len(), 1.0),
            Growth::WithLoad => DVector::from_column_slice(&self.loads),
        }
    }

    /// Refuse frames that are none.
    pub(super) fn check(&self) -> Result<()> {
        if self.is_empty() || self.blocks.is_empty() {
            return Err(Error::input(
                "steps",
                "at least one frame with measured points",
            ));
        }
        if let Some(load) = self.loads.iter().find(|f| !f.is_finite()) {
            return Err(Error::program("noise::series", "finite loads").found(load));
        }
        match self.subset_mm {
            Some(w) if !(w > 0.0 && w.is_finite()) => {
                Err(Error::program("noise::series", "a positive subset").found(w))
            }
            _ => Ok(()),
        }
    }
}
