//! Products and eigenvectors of dense matrices, each on one thread: the same bits for any number of threads.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::prelude::default;
use faer::{Accum, Col, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// A matrix as the library sees it.
pub fn view(m: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

/// The same, to be changed.
pub fn view_mut(m: &mut DMatrix<f64>) -> MatMut<'_, f64> {
    let (rows, columns) = m.shape();
    MatMut::from_column_major_slice_mut(m.as_mut_slice(), rows, columns)
}

/// A B.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut c = DMatrix::zeros(a.nrows(), b.ncols());
    let (a, b) = (view(a), view(b));
    matmul(view_mut(&mut c), Accum::Replace, a, b, 1.0, Par::Seq);
    c
}

/// A' B.
pub fn tr_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut c = DMatrix::zeros(a.ncols(), b.ncols());
    let (a, b) = (view(a).transpose(), view(b));
    matmul(view_mut(&mut c), Accum::Replace, a, b, 1.0, Par::Seq);
    c
}

/// A' A.
pub fn gram(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut c = DMatrix::zeros(a.ncols(), a.ncols());
    triangular::matmul(
        view_mut(&mut c),
        BlockStructure::TriangularLower,
        Accum::Replace,
        view(a).transpose(),
        BlockStructure::Rectangular,
        view(a),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
    c.fill_upper_triangle_with_lower_triangle();
    c
}

/// Eigenvalues, increasing, and eigenvectors of a symmetric matrix, of which the lower half is read.
///
/// # Errors
/// The program's, if the decomposition does not converge.
pub fn eigen(m: &DMatrix<f64>) -> Result<(DVector<f64>, DMatrix<f64>)> {
    let n = m.nrows();
    let mut values = Col::<f64>::zeros(n);
    let mut vectors = DMatrix::zeros(n, n);
    let yes = ComputeEigenvectors::Yes;
    let need = self_adjoint_evd_scratch::<f64>(n, yes, Par::Seq, default());
    self_adjoint_evd(
        view(m),
        values.as_diagonal_mut(),
        Some(view_mut(&mut vectors)),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(need)),
        default(),
    )
    .map_err(|e| {
        Error::program("dense", "an eigendecomposition that converges").found(format!("{e:?}"))
    })?;
    Ok((DVector::from_iterator(n, values.iter().copied()), vectors))
}
