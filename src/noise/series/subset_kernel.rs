//! White pixel noise as image correlation passes it on: averaged over a square subset, which neighbouring points share.
//!
//! An affine fit over a square subset reports the mean at its centre; two points whose subsets of side w overlap then share the noise
//! of the pixels in common, and correlate as (1 - |ds| / w)+ (1 - |dt| / w)+.

use nalgebra::DMatrix;

use crate::field::Blocks;
use crate::field::places::BlockPoints;

/// Covariance of the averages over `blocks` of noise whose points have unit variance and the correlation of square subsets of side
/// `subset_mm`: the mean of that correlation over the points of both blocks, exact where the blocks know their points, and over
/// rectangles of their points' spread where they are too many.
pub fn subset_covariance(blocks: &Blocks, subset_mm: f64) -> DMatrix<f64> {
    let n = blocks.len();
    let triangle = |[s, t]: [f64; 2]| triangle(s, subset_mm) * triangle(t, subset_mm);
    let of_sites = match &blocks.places {
        BlockPoints::OnLattice(lattice) => lattice.tabulate_offsets(triangle),
        BlockPoints::Many | BlockPoints::Anywhere(_) => Vec::new(),
    };
    // blocks are square tiles: points of two lie no closer than their centroids do, less the sides of both
    let reach = subset_mm + 2.0 * blocks.size_mm;
    let between = |i: usize, j: usize| {
        let (a, b) = (blocks.centroid[i], blocks.centroid[j]);
        let offset = [a[0] - b[0], a[1] - b[1]];
        if offset.iter().any(|d| d.abs() >= reach) {
            return 0.0;
        }
        match &blocks.places {
            BlockPoints::Many => [0, 1]
                .map(|k| {
                    let side =
                        [blocks.spread[i][k], blocks.spread[j][k]].map(|v| (12.0 * v).sqrt());
                    over_intervals(offset[k], side, subset_mm)
                })
                .iter()
                .product(),
            BlockPoints::Anywhere(points) => mean_over(&points[i], &points[j], |p, q| {
                triangle([p[0] - q[0], p[1] - q[1]])
            }),
            BlockPoints::OnLattice(lattice) => {
                mean_over(&lattice.sites[i], &lattice.sites[j], |p, q| {
                    of_sites[p.abs_diff(*q) as usize]
                })
            }
        }
    };
    let mut covariance = DMatrix::zeros(n, n);
    for j in 0..n {
        for i in j..n {
            let value = between(i, j);
            covariance[(i, j)] = value;
            covariance[(j, i)] = value;
        }
    }
    covariance
}

/// (1 - |d| / w)+.
fn triangle(d: f64, w: f64) -> f64 {
    (1.0 - d.abs() / w).max(0.0)
}

/// Mean of f over all pairs of a and b.
fn mean_over<T>(a: &[T], b: &[T], f: impl Fn(&T, &T) -> f64) -> f64 {
    let to = |p: &T| b.iter().map(|q| f(p, q)).sum::<f64>();
    a.iter().map(to).sum::<f64>() / (a.len() * b.len()) as f64
}

/// Intervals are at least this part of a subset long: the mean of a single point's triangle is that of a short interval.
const SHORT: f64 = 1e-3;

/// Mean of the triangle over the points of two intervals of given `side`s whose centres are `offset` apart, by its second
/// antiderivative.
fn over_intervals(offset: f64, side: [f64; 2], w: f64) -> f64 {
    let twice = |x: f64| {
        let x = x.abs();
        if x < w {
            0.5 * x * x - x * x * x / (6.0 * w)
        } else {
            w * w / 3.0 + 0.5 * w * (x - w)
        }
    };
    let [a, b] = side.map(|s| s.max(SHORT * w));
    let (sum, difference) = (0.5 * (a + b), 0.5 * (a - b));
    let total = twice(offset + sum) - twice(offset + difference) - twice(offset - difference)
        + twice(offset - sum);
    (total / (a * b)).max(0.0)
}
