//! Frame space: the contrasts that no law can reach, and their covariance.

use nalgebra::{DMatrix, DVector};

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

/// Contrasts c of frames orthogonal to (1, .., 1) and to the loads, with c' D c = 1 of D = diag(`scales`) and orthogonal under it: the first
/// goes as the loads' square, as far as the laws do not; frames x contrasts. None where the square is nothing beside the laws.
pub(super) fn weighted(loads: &[f64], scales: &[f64]) -> Option<DMatrix<f64>> {
    let count = loads.len();
    let root = DVector::from_iterator(count, scales.iter().map(|d| d.sqrt()));
    let whitened = |of: &dyn Fn(f64) -> f64| {
        let values = loads.iter().zip(root.iter()).map(|(f, d)| of(*f) / d);
        DVector::from_iterator(count, values)
    };
    let laws = [whitened(&|_| 1.0), whitened(&|f| f), whitened(&|f| f * f)];
    let mut found: Vec<DVector<f64>> = Vec::new();
    let unit = (0..count).map(|k| DVector::from_fn(count, |i, _| f64::from(i == k)));
    for (k, of) in laws.into_iter().chain(unit).enumerate() {
        let size = of.norm();
        let mut left = of;
        for _ in 0..2 {
            for known in &found {
                let inside = known.dot(&left);
                left.axpy(-inside, known, 1.0);
            }
        }
        if left.norm() > DISTINCT * size {
            found.push(left.normalize());
        } else if k < 3 {
            return None;
        }
    }
    let contrasts: Vec<DVector<f64>> = found
        .iter()
        .skip(3)
        .map(|c| c.component_div(&root))
        .collect();
    let square = found.get(2)?.component_div(&root);
    let all: Vec<DVector<f64>> = [square].into_iter().chain(contrasts).collect();
    Some(DMatrix::from_columns(&all))
}

/// What is beside the laws less than this part of its size follows them.
const DISTINCT: f64 = 1e-3;

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

/// That of a random walk: the noise of every frame is that of the frame before and its own.
pub(super) fn covariance_of_walk(d: &[f64]) -> DMatrix<f64> {
    let until = |s: usize| d[..=s].iter().sum();
    DMatrix::from_fn(d.len(), d.len(), |s, t| until(s.min(t)))
}
