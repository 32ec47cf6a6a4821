//! Proper orthogonal decomposition of a snapshot matrix, without centring.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::prelude::default;
use faer::{Mat, Par};

use crate::error::{Error, Result};

/// POD of a snapshot matrix (n x N): X = modes diag(singular) right^T.
#[derive(Debug)]
pub struct Pod {
    /// Orthonormal modes, n x r with r at most N.
    pub modes: Mat<f64>,
    /// Singular values, decreasing.
    pub singular: Vec<f64>,
    /// Right singular vectors, N x r.
    pub right: Mat<f64>,
}

/// Decompose a snapshot matrix by a thin SVD. The result does not depend on the number of threads.
pub fn decompose(snapshots: &Mat<f64>) -> Result<Pod> {
    let (n, count) = (snapshots.nrows(), snapshots.ncols());
    let r = n.min(count);
    let (mut modes, mut right) = (Mat::zeros(n, r), Mat::zeros(count, r));
    let mut singular = faer::Col::<f64>::zeros(r);
    let need = svd_scratch::<f64>(
        n,
        count,
        ComputeSvdVectors::Thin,
        ComputeSvdVectors::Thin,
        Par::Seq,
        default(),
    );
    svd(
        snapshots.as_ref(),
        singular.as_diagonal_mut(),
        Some(modes.as_mut()),
        Some(right.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(need)),
        default(),
    )
    .map_err(|e| {
        Error::program("POD", "a singular value decomposition that converges")
            .found(format!("{e:?}"))
    })?;
    Ok(Pod {
        modes,
        singular: singular.iter().copied().collect(),
        right,
    })
}

/// POD of fields (n x N) by what a lattice of points sees of them (P x N): the modes are those combinations of the fields that are
/// orthonormal at the lattice's points, whatever the n points are that they are kept at.
pub fn decompose_as_seen(fields: &Mat<f64>, seen: &Mat<f64>) -> Result<Pod> {
    let pod = decompose(seen)?;
    let largest = pod.singular.first().copied().unwrap_or(0.0);
    let inverse = |k: usize| match pod.singular[k] {
        s if s > ROUNDING * largest => 1.0 / s,
        _ => 0.0,
    };
    let weights = Mat::from_fn(pod.right.nrows(), pod.right.ncols(), |i, k| {
        pod.right[(i, k)] * inverse(k)
    });
    Ok(Pod {
        modes: fields * &weights,
        ..pod
    })
}

/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-14;

impl Pod {
    /// Truncation error of `k` modes (Gogu et al. 2013, Eq. 10): 1 - sum_{j<=k} s_j^2 / sum s_j^2, summed from the
    /// small end so that it does not drown in rounding.
    pub fn truncation_error(&self, k: usize) -> f64 {
        let tail: f64 = self.singular.iter().skip(k).rev().map(|s| s * s).sum();
        let total: f64 = self.singular.iter().rev().map(|s| s * s).sum();
        tail / total
    }

    /// What `k` modes leave of the snapshots, root mean square over them and their `points`, mm.
    pub fn left_mm(&self, k: usize, points: usize) -> f64 {
        let tail: f64 = self.singular.iter().skip(k).map(|s| s * s).sum();
        (tail / (points * self.right.nrows()) as f64).sqrt()
    }

    /// Coefficients of the snapshots in the first `k` modes: N x k, mm.
    pub fn coefficients(&self, k: usize) -> Mat<f64> {
        Mat::from_fn(self.right.nrows(), k, |i, j| {
            self.right[(i, j)] * self.singular[j]
        })
    }
}
