//! The lowest eigenvalues of dense symmetric pairs, on one thread: the same bits for any number of threads.

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::prelude::default;
use nalgebra::DMatrix;

use crate::dense::{eigen, view, view_mut};
use crate::error::{Error, Result};

const PLACE: &str = "natural frequencies";

/// The `count` lowest eigenvalues of K c = lambda M c, increasing, with eigenvectors of c' M c = 1 (n x count).
///
/// K (n x n) is positive definite, M symmetric and at least semidefinite, both of n > 0 and full. With K = L L' the largest eigenvalues of
/// L^-1 M L'^-1 are found, which keeps the lowest lambda accurate when the stiffest functions are 1e12 times as stiff.
///
/// # Errors
/// The input's fault if K is not positive definite; the program's if the decomposition does not converge.
pub fn lowest(
    mut k: DMatrix<f64>,
    mut m: DMatrix<f64>,
    count: usize,
) -> Result<(Vec<f64>, DMatrix<f64>)> {
    let n = k.nrows();
    let need = cholesky_in_place_scratch::<f64>(n, Par::Seq, default());
    cholesky_in_place(
        view_mut(&mut k),
        default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(need)),
        default(),
    )
    .map_err(|_| {
        Error::input(PLACE, "a positive definite stiffness")
            .hint("are the elastic constants admissible?")
    })?;
    let factor = view(&k);
    solve_lower_triangular_in_place(factor, view_mut(&mut m), Par::Seq);
    solve_lower_triangular_in_place(factor, view_mut(&mut m).transpose_mut(), Par::Seq);
    let (values, vectors) = eigen(&m)?;
    let count = count.min(n);
    // largest flexibilities first
    let lambda: Vec<f64> = (0..count).map(|i| 1.0 / values[n - 1 - i]).collect();
    let mut lowest = DMatrix::from_fn(n, count, |r, i| {
        vectors[(r, n - 1 - i)] * lambda[i].abs().sqrt()
    });
    solve_upper_triangular_in_place(factor.transpose(), view_mut(&mut lowest), Par::Seq);
    Ok((lambda, lowest))
}
