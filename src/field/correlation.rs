//! The `image_correlation` object of a measurement: how images became displacements.

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use crate::error::{Error, Result};

/// The `image_correlation` object of a measurement.
#[skip_serializing_none]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageCorrelation {
    /// Side of a subset, mm: over about as much the noise is correlated.
    pub subset_mm: f64,
    /// Side of the subset over which averages are taken and noise is correlated, mm, where a loop found another than the declared one. Points
    /// go whose subset of that size reaches over an edge.
    pub effective_subset_mm: Option<f64>,
    /// Distance of neighbouring points, mm, where it is declared.
    pub step_mm: Option<f64>,
    /// Shape function of the subsets, where it is declared.
    pub shape: Option<SubsetShape>,
    /// Distance of the camera from the specimen, mm, where it is declared.
    pub camera_distance_mm: Option<f64>,
    /// Size of a pixel on the specimen, mm, where it is declared.
    pub pixel_mm: Option<f64>,
    /// What happens to points whose subset reaches over an edge or the hole.
    #[serde(default, skip_serializing_if = "PartialSubsets::is_default")]
    pub partial_subsets: PartialSubsets,
}

/// What happens to points whose subset reaches over an edge or the hole: the fit on what is left of it is another average.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartialSubsets {
    /// They are dropped and counted.
    #[default]
    Dropped,
    /// They stay, observed over what is left of the subset.
    Kept,
}

impl PartialSubsets {
    #[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// How the displacement varies over a subset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SubsetShape {
    Full,
    Affine,
    Quadratic,
}

impl ImageCorrelation {
    /// Refuse values no correlation can have.
    pub(super) fn check(&self) -> Result<()> {
        let given = [
            ("subset_mm", Some(self.subset_mm)),
            ("effective_subset_mm", self.effective_subset_mm),
            ("step_mm", self.step_mm),
            ("camera_distance_mm", self.camera_distance_mm),
            ("pixel_mm", self.pixel_mm),
        ];
        for (key, value) in given {
            let value = value.unwrap_or(1.0);
            if !(value.is_finite() && value > 0.0) {
                let place = format!("image_correlation.{key}");
                return Err(Error::input(place, "a positive length in mm").found(value));
            }
        }
        Ok(())
    }
}
