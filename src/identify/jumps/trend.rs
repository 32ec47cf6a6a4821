//! The smooth part of a difference: rotation, bending and the like, out of the way of the search.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use crate::field::bounds;
use crate::numeric::median;

type Cubic = SVector<f64, 10>;

/// `values` at `points` less a cubic of the place, fitted robustly. What a jump bends it is spread over the
/// whole field and makes no step from point to point.
pub(super) fn without(points: &[[f64; 2]], values: &[f64]) -> Vec<f64> {
    const MOST: usize = 20_000;
    const SWEEPS: usize = 16;
    /// Deviations below this count alike, orders.
    const ALIKE: f64 = 0.1;
    /// Deviations beyond this count ever less, orders.
    const FAR: f64 = 0.25;
    let [low, high] = bounds(points);
    let half = (0..2)
        .map(|k| 0.5 * (high[k] - low[k]))
        .fold(f64::MIN_POSITIVE, f64::max);
    let row = |p: &[f64; 2]| {
        let [s, t] = [0, 1].map(|k| (p[k] - 0.5 * (low[k] + high[k])) / half);
        Cubic::from([
            1.0,
            s,
            t,
            s * s,
            s * t,
            t * t,
            s * s * s,
            s * s * t,
            s * t * t,
            t * t * t,
        ])
    };
    // an odd stride wanders through the columns of most grids
    let used: Vec<(Cubic, f64)> = (0..points.len())
        .step_by((points.len() / MOST) | 1)
        .map(|i| (row(&points[i]), values[i]))
        .collect();
    let mut weights = vec![1.0; used.len()];
    let mut fit = Cubic::zeros();
    for sweep in 0..SWEEPS {
        let mut gram = SMatrix::<f64, 10, 10>::zeros();
        let mut right = Cubic::zeros();
        for ((row, value), w) in used.iter().zip(&weights) {
            gram.ger(*w, row, row, 1.0);
            right.axpy(w * value, row, 1.0);
        }
        let ridge = 1e-12 * gram.trace();
        (0..10).for_each(|k| gram[(k, k)] += ridge);
        let Some(factor) = gram.cholesky() else { break };
        fit = factor.solve(&right);
        let deviation: Vec<f64> = used
            .iter()
            .map(|(row, value)| (value - row.dot(&fit)).abs())
            .collect();
        let typical = median(&mut deviation.clone());
        // absolute deviations first; then whole jumps lose their say, where they are what is left
        let waves = typical > ALIKE;
        for (d, w) in deviation.iter().zip(&mut weights) {
            *w = if waves || sweep < SWEEPS / 2 {
                ALIKE / d.max(ALIKE)
            } else {
                (1.0 + (d / FAR).powi(2)).powi(-2)
            };
        }
    }
    points
        .par_iter()
        .zip(values)
        .map(|(p, v)| v - row(p).dot(&fit))
        .collect()
}
