//! Small dense symmetric systems whose unknowns have very different sizes.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// Scale a symmetric matrix to a unit diagonal, so that columns of very different size do not spoil its inverse.
fn unit_scaling(m: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        m.nrows(),
        (0..m.nrows()).map(|k| 1.0 / m[(k, k)].max(f64::MIN_POSITIVE).sqrt()),
    )
}

/// Solve a symmetric positive semi-definite system; directions without information get 0.
pub fn solve(m: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let d = unit_scaling(m);
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * d[i] * d[j]);
    let eigen = nalgebra::SymmetricEigen::new(scaled);
    let floor = 1e-13 * eigen.eigenvalues.amax();
    let mut x = eigen.eigenvectors.tr_mul(&b.component_mul(&d));
    for (x, &e) in x.iter_mut().zip(&eigen.eigenvalues) {
        *x = if e > floor { *x / e } else { 0.0 };
    }
    (eigen.eigenvectors * x).component_mul(&d)
}

/// Inverse of a symmetric positive definite matrix; an error of the declared effects if it is not.
pub fn invert(m: DMatrix<f64>) -> Result<DMatrix<f64>> {
    if m.nrows() == 0 {
        return Ok(m);
    }
    let d = unit_scaling(&m);
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * d[i] * d[j]);
    let inverse = scaled
        .cholesky()
        .ok_or_else(|| {
            Error::input(
                "effects",
                "declared effects that differ on the measured points",
            )
            .found("effects whose columns depend on each other")
            .hint("declare only one of them")
        })?
        .inverse();
    Ok(DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
        inverse[(i, j)] * d[i] * d[j]
    }))
}
