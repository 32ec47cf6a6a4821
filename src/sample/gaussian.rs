//! The little linear algebra of the moves: Cholesky factors in row-major slices, no allocation in a loop.

use pulp::{Simd, WithSimd};

use super::moves::Walkers;

/// Lower Cholesky factor of the `dim` x `dim` row-major matrix `a`, in place (the upper triangle is zeroed). False if
/// `a` is not positive definite to working precision.
pub(crate) fn cholesky(a: &mut [f64], dim: usize) -> bool {
    for i in 0..dim {
        let scale = a[i * dim + i];
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| a[i * dim + k] * a[j * dim + k]).sum();
            let rest = a[i * dim + j] - dot;
            if i != j {
                a[i * dim + j] = rest / a[j * dim + j];
            } else if rest > 1e-14 * scale && rest.is_finite() {
                a[i * dim + i] = rest.sqrt();
            } else {
                return false;
            }
        }
        a[i * dim + i + 1..(i + 1) * dim].fill(0.0);
    }
    true
}

/// x of L L^T x = `b`, in place, for a lower triangular row-major `lower`.
pub(super) fn solve(lower: &[f64], b: &mut [f64]) {
    let dim = b.len();
    whiten(lower, b);
    for i in (0..dim).rev() {
        let dot: f64 = (i + 1..dim).map(|k| lower[k * dim + i] * b[k]).sum();
        b[i] = (b[i] - dot) / lower[i * dim + i];
    }
}

/// Singular values of a matrix whose columns of `rows` numbers follow each other: columns are turned in pairs until all are orthogonal
/// (Hestenes 1958), which loses no digits of the small ones.
pub(super) fn singular_values(mut columns: Vec<f64>, rows: usize) -> Vec<f64> {
    const SWEEPS: usize = 40;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let count = columns.len() / rows.max(1);
    for _ in 0..SWEEPS {
        let mut largest = 0.0_f64;
        for second in 1..count {
            let (before, from_second) = columns.split_at_mut(second * rows);
            let b = &mut from_second[..rows];
            for a in before.chunks_exact_mut(rows) {
                let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
                let cosine = ab.abs() / (aa * bb).sqrt();
                if cosine <= f64::EPSILON || !cosine.is_finite() {
                    continue;
                }
                largest = largest.max(cosine);
                let zeta = (bb - aa) / (2.0 * ab);
                let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let c = tangent.hypot(1.0).recip();
                for (a, b) in a.iter_mut().zip(&mut *b) {
                    (*a, *b) = (c * (*a - tangent * *b), c * (tangent * *a + *b));
                }
            }
        }
        if largest < 1e-14 {
            break;
        }
    }
    let columns = columns.chunks_exact(rows);
    columns.map(|c| dot(c, c).sqrt()).collect()
}

/// `out += scale * L z` for a lower triangular row-major `lower`.
pub(crate) fn add_lower(lower: &[f64], z: &[f64], scale: f64, out: &mut [f64]) {
    let dim = z.len();
    for (i, value) in out.iter_mut().enumerate() {
        let row = &lower[i * dim..=i * dim + i];
        *value += scale * row.iter().zip(z).map(|(l, z)| l * z).sum::<f64>();
    }
}

/// |L^-1 r|^2; `r` becomes L^-1 r.
pub(crate) fn whiten(lower: &[f64], r: &mut [f64]) -> f64 {
    let dim = r.len();
    let mut sum = 0.0;
    for i in 0..dim {
        let dot: f64 = (0..i).map(|k| lower[i * dim + k] * r[k]).sum();
        r[i] = (r[i] - dot) / lower[i * dim + i];
        sum += r[i] * r[i];
    }
    sum
}

/// Mean and scatter matrix (sum of outer products of deviations) of walkers.
pub(crate) fn scatter(walkers: Walkers<'_>, mean: &mut [f64], scatter: &mut [f64]) {
    pulp::Arch::new().dispatch(Scatter {
        walkers,
        mean,
        scatter,
    });
}

struct Scatter<'a> {
    walkers: Walkers<'a>,
    mean: &'a mut [f64],
    scatter: &'a mut [f64],
}

impl WithSimd for Scatter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            walkers,
            mean,
            scatter,
        } = self;
        let (dim, n) = (walkers.dim(), walkers.count() as f64);
        for (mean, x) in mean.iter_mut().zip(walkers.columns()) {
            *mean = sum(x) / n;
        }
        for (i, x) in walkers.columns().enumerate() {
            for (j, y) in walkers.columns().enumerate().take(i + 1) {
                let value = sum_of_products(x, mean[i], y, mean[j]);
                scatter[i * dim + j] = value;
                scatter[j * dim + i] = value;
            }
        }
    }
}

/// Partial sums side by side, which a processor adds at once.
const SIDE: usize = 8;

#[inline(always)]
fn sum(x: &[f64]) -> f64 {
    let mut sums = [0.0; SIDE];
    let (whole, rest) = x.as_chunks::<SIDE>();
    for x in whole {
        for k in 0..SIDE {
            sums[k] += x[k];
        }
    }
    for (sum, x) in sums.iter_mut().zip(rest) {
        *sum += x;
    }
    sums.iter().sum()
}

/// Sum of (x - a) (y - b).
#[inline(always)]
fn sum_of_products(x: &[f64], a: f64, y: &[f64], b: f64) -> f64 {
    let mut sums = [0.0; SIDE];
    let (whole, rest) = x.as_chunks::<SIDE>();
    let (other, other_rest) = y.as_chunks::<SIDE>();
    for (x, y) in whole.iter().zip(other) {
        for k in 0..SIDE {
            sums[k] += (x[k] - a) * (y[k] - b);
        }
    }
    for ((sum, x), y) in sums.iter_mut().zip(rest).zip(other_rest) {
        *sum += (x - a) * (y - b);
    }
    sums.iter().sum()
}
