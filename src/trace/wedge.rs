//! Evidence of two amplitudes that lie in a wedge: the first is not negative, nor is a sum of both.

use nalgebra::{Matrix2, Vector2};

/// log (2 Phi(z)): what a half-normal prior makes of evidence under a normal one, for an amplitude `z` sds from zero.
pub fn log_positive(z: f64) -> f64 {
    if z < -30.0 {
        return -0.5 * z * z;
    }
    statrs::function::erf::erfc(-z / std::f64::consts::SQRT_2).ln()
}

/// Log of the posterior mass of a wedge over its prior mass, for two amplitudes in prior sds: the first is not negative, nor is the sum with
/// these weights. The posterior mass is bounded from above by that of the least probable half-plane that holds the wedge; the prior's is
/// Sheppard's (1899, Phil. Trans. R. Soc. A 192, 101).
pub fn log_in_wedge(mean: Vector2<f64>, covariance: &Matrix2<f64>, weights: [f64; 2]) -> f64 {
    let edges = Matrix2::new(1.0, 0.0, weights[0], weights[1]);
    let sums = edges * mean;
    let spread = edges * covariance * edges.transpose();
    let single = |k: usize| sums[k] / spread[(k, k)].sqrt();
    let z = match spread.try_inverse().map(|inverse| inverse * sums) {
        Some(across) if across.max() <= 0.0 => -sums.dot(&across).max(0.0).sqrt(),
        _ => single(0).min(single(1)),
    };
    let cosine = weights[0] / weights[0].hypot(weights[1]);
    let prior = 0.25 + cosine.asin() / std::f64::consts::TAU;
    log_positive(z) - (2.0 * prior).ln()
}
