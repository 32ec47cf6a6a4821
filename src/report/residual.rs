//! The residual and the noise in `report.json`: lengths in mm, displacements in nm, of u1 along the load and u2 across.

use serde::{Deserialize, Serialize};

use crate::field::Rejected;
use crate::identify::Patterns;

/// A quantity of each displacement component.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ByComponent<T> {
    pub u1: T,
    pub u2: T,
}

impl<T> From<[T; 2]> for ByComponent<T> {
    fn from([u1, u2]: [T; 2]) -> Self {
        Self { u1, u2 }
    }
}

/// What the posterior mean leaves unexplained.
#[derive(Debug, Serialize, Deserialize)]
pub struct ResidualReport {
    pub rms_nm: RmsReport,
    /// Standard deviation of the noise at a point.
    pub noise_nm: ByComponent<f64>,
    pub chi2_reduced: f64,
    /// Share of the mean square that is not noise.
    pub structured_fraction: f64,
    #[serde(default)]
    pub patterns: Patterns,
    pub n: usize,
    /// Number of independent values of both components that they count as.
    pub n_eff: f64,
    /// RMS error of held-out block averages, where the residual was traced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holdout_rms_nm: Option<f64>,
}

/// Root mean squares, nm.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct RmsReport {
    pub u1: f64,
    pub u2: f64,
    pub all: f64,
}

/// The measurement's noise.
#[derive(Debug, Serialize, Deserialize)]
pub struct NoiseReport {
    pub u1: NoiseComponent,
    pub u2: NoiseComponent,
    pub block_mm: f64,
    pub blocks: usize,
    /// Points that were not used, by reason.
    pub points_dropped: Rejected,
}

/// Noise of one component: standard deviations, and the length of the correlated part.
#[derive(Debug, Serialize, Deserialize)]
pub struct NoiseComponent {
    /// Of the white part, from neighbouring points.
    pub white_nm: f64,
    /// Of the white part, as the block averages have it.
    pub block_white_nm: f64,
    /// Of the correlated part.
    pub correlated_nm: f64,
    pub length_mm: f64,
}
