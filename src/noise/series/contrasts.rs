//! Frame space: the contrasts that no law can reach, and their covariance.

use nalgebra::DMatrix;

use super::frames::Frames;
use crate::error::{Error, Result};
use crate::noise::reml::orthonormal;

/// Parts of a unit vector below this are rounding.
const ROUNDING: f64 = 1e-7;

/// Orthonormal frame contrasts orthogonal to every law of the frames: frames x contrasts; none for few frames.
pub(super) fn beyond_laws(frames: &Frames<'_>) -> DMatrix<f64> {
    let laws: Vec<_> = frames.laws().iter().map(|&l| frames.direction(l)).collect();
    let laws = orthonormal(&DMatrix::from_columns(&laws));
    let count = frames.len();
    let mut beyond = DMatrix::identity(count, count) - &laws * laws.transpose();
    // what rounding leaves of a direction of the laws is none
    for mut left in beyond.column_iter_mut().filter(|c| c.norm() < ROUNDING) {
        left.fill(0.0);
    }
    let kept: Vec<_> = orthonormal(&beyond)
        .column_iter()
        .take(count - laws.ncols())
        .map(|c| c.into_owned())
        .collect();
    if kept.is_empty() {
        DMatrix::zeros(count, 0)
    } else {
        DMatrix::from_columns(&kept)
    }
}

/// The metric of contrasts B under a covariance Phi of frames.
pub(super) struct Metric {
    /// S = B (B' Phi B)^-1 B', frames x frames; it depends on the span of B only.
    pub s: DMatrix<f64>,
    /// R of S = R R', frames x contrasts.
    pub root: DMatrix<f64>,
    /// log det B' Phi B.
    pub log_det: f64,
}

impl Metric {
    /// Of `contrasts` under `phi`.
    pub fn new(contrasts: &DMatrix<f64>, phi: &DMatrix<f64>) -> Result<Self> {
        let inside = contrasts.transpose() * phi * contrasts;
        let factor = inside.cholesky().ok_or_else(|| {
            Error::program("noise::series", "a positive definite covariance of frames")
        })?;
        let lower = factor.l();
        let root = lower
            .solve_lower_triangular(&contrasts.transpose())
            .ok_or_else(|| Error::program("noise::series", "independent frame contrasts"))?
            .transpose();
        Ok(Self {
            s: &root * root.transpose(),
            log_det: 2.0 * lower.diagonal().iter().map(|d| d.ln()).sum::<f64>(),
            root,
        })
    }
}

/// Covariance of frames: own noise of scales `d` and a reference's share `r`.
pub(super) fn covariance_of_frames(d: &[f64], r: f64) -> DMatrix<f64> {
    DMatrix::from_fn(d.len(), d.len(), |s, t| r + if s == t { d[s] } else { 0.0 })
}
