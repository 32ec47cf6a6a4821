//! Gauss rules from the eigenvalues of Jacobi matrices.

use nalgebra::{DMatrix, SymmetricEigen};

/// Gauss-Legendre rule: nodes and weights of the mean over [0, 1].
pub fn legendre(nodes: usize) -> Vec<(f64, f64)> {
    let rule = golub_welsch(nodes, |k| k / (4.0 * k * k - 1.0).sqrt());
    rule.into_iter().map(|(x, w)| (0.5 + 0.5 * x, w)).collect()
}

/// Gauss-Hermite rule: nodes and weights of the mean over a standard normal distribution.
pub fn hermite(nodes: usize) -> Vec<(f64, f64)> {
    golub_welsch(nodes, f64::sqrt)
}

/// The rule of a symmetric probability density whose orthonormal polynomials obey
/// x p_k = `off`(k + 1) p_(k+1) + `off`(k) p_(k-1): nodes are the eigenvalues of the Jacobi matrix, weights the squared first
/// components of its eigenvectors (Golub and Welsch, Math. Comp. 23, 1969).
fn golub_welsch(nodes: usize, off: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let jacobi = DMatrix::from_fn(nodes, nodes, |i, j| {
        if i.abs_diff(j) == 1 {
            off(i.max(j) as f64)
        } else {
            0.0
        }
    });
    let eigen = SymmetricEigen::new(jacobi);
    let weights = eigen.eigenvectors.row(0).map(|v| v * v);
    let found = eigen.eigenvalues.iter().zip(weights.iter());
    let mut rule: Vec<(f64, f64)> = found.map(|(x, w)| (*x, *w)).collect();
    rule.sort_by(|a, b| a.0.total_cmp(&b.0));
    rule
}
