//! Polynomials as sums over monomials that lie in memory.

use pulp::Simd;

use super::forms::GROUP;
use super::lanes::{Lanes, each, ln};
use super::nested::BLOCK;

/// Two vectors of points.
pub(super) type Two<V> = [V; 2];

/// Polynomials of all coordinates over monomials, in two layouts.
#[derive(Debug, Clone, Default)]
pub(super) struct Polynomials {
    /// Monomial by monomial, each padded to whole blocks of coordinates.
    pub rows: Vec<f64>,
    /// [`GROUP`] by group of coordinates, in each monomial by monomial.
    groups: Vec<f64>,
}

impl Polynomials {
    pub(super) fn new(columns: &[Vec<f64>], padded: usize) -> Self {
        let mut rows = vec![0.0; columns.len() * padded];
        for (row, column) in rows.chunks_exact_mut(padded).zip(columns) {
            row[..column.len()].copy_from_slice(column);
        }
        let mut groups = Vec::with_capacity(rows.len());
        for first in (0..padded).step_by(GROUP) {
            for row in rows.chunks_exact(padded) {
                groups.extend_from_slice(&row[first..first + GROUP]);
            }
        }
        Self { rows, groups }
    }

    pub(super) fn group(&self, group: usize, padded: usize) -> &[f64] {
        let length = self.rows.len() / padded * GROUP;
        &self.groups[group * length..(group + 1) * length]
    }
}

/// Sum over m of coefficients[m][k] monomials[m] for a group of coordinates k and two vectors of points.
#[inline(always)]
pub(super) fn accumulate<S: Simd>(
    simd: S,
    coefficients: &[f64],
    monomials: &[Lanes],
    pair: usize,
) -> [Two<S::f64s>; GROUP] {
    let mut sum = [[simd.splat_f64s(0.0); 2]; GROUP];
    for (c, monomial) in coefficients.chunks_exact(GROUP).zip(monomials) {
        let (m, _) = S::as_simd_f64s(monomial);
        let (a, b) = (m[pair], m[pair + 1]);
        for k in 0..GROUP {
            let c = simd.splat_f64s(c[k]);
            sum[k][0] = simd.mul_add_e_f64s(c, a, sum[k][0]);
            sum[k][1] = simd.mul_add_e_f64s(c, b, sum[k][1]);
        }
    }
    sum
}

/// The same for one point, with the coordinates side by side.
#[inline(always)]
pub(super) fn accumulate_single<S: Simd>(
    simd: S,
    rows: &[f64],
    monomials: &[f64],
    out: &mut [f64],
) {
    let padded = out.len();
    for (block, out) in out.chunks_exact_mut(BLOCK).enumerate() {
        let (out, _) = S::as_mut_simd_f64s(out);
        let mut sum = [simd.splat_f64s(0.0); BLOCK];
        let used = BLOCK / S::F64_LANES;
        for (row, &m) in rows.chunks_exact(padded).zip(monomials) {
            let (c, _) = S::as_simd_f64s(&row[block * BLOCK..(block + 1) * BLOCK]);
            let m = simd.splat_f64s(m);
            for v in 0..used {
                sum[v] = simd.mul_add_e_f64s(c[v], m, sum[v]);
            }
        }
        out.copy_from_slice(&sum[..used]);
    }
}

/// Adds a group of coordinates to the sums (r' V^-1 r, w' V^-1 w, w' V^-1 r) and returns the product of the variances.
/// Multiplication and addition are apart, as for one point.
#[inline(always)]
pub(super) fn add_group<S: Simd>(
    simd: S,
    measured: &[f64],
    [mean, response]: [&[Two<S::f64s>; GROUP]; 2],
    spread: Option<(&[f64], Two<S::f64s>)>,
    sum: &mut [Two<S::f64s>; 3],
) -> Two<S::f64s> {
    let one = simd.splat_f64s(1.0);
    let mut product = [one; 2];
    for k in 0..GROUP {
        for h in 0..2 {
            let r = simd.sub_f64s(simd.splat_f64s(measured[k]), mean[k][h]);
            let w = response[k][h];
            let (mut rv, mut wv) = (r, w);
            if let Some((mu, variance)) = spread {
                let mu = simd.splat_f64s(mu[k]);
                let v = simd.add_f64s(one, simd.mul_f64s(variance[h], mu));
                product[h] = simd.mul_f64s(product[h], v);
                let inverse = simd.div_f64s(one, v);
                (rv, wv) = (simd.mul_f64s(r, inverse), simd.mul_f64s(w, inverse));
            }
            sum[0][h] = simd.add_f64s(sum[0][h], simd.mul_f64s(r, rv));
            sum[1][h] = simd.add_f64s(sum[1][h], simd.mul_f64s(w, wv));
            sum[2][h] = simd.add_f64s(sum[2][h], simd.mul_f64s(w, rv));
        }
    }
    product
}

/// Adds the logarithm of two vectors of points to their lanes.
#[inline(always)]
pub(super) fn add_logarithm<S: Simd>(simd: S, product: Two<S::f64s>, pair: usize, out: &mut Lanes) {
    let mut lanes = Lanes::splat(1.0);
    {
        let (lanes, _) = S::as_mut_simd_f64s(&mut lanes);
        (lanes[pair], lanes[pair + 1]) = (product[0], product[1]);
    }
    let logarithms = each(|l| ln(lanes[l]));
    let (logarithms, _) = S::as_simd_f64s(&logarithms);
    let (out, _) = S::as_mut_simd_f64s(out);
    for h in 0..2 {
        out[pair + h] = simd.add_f64s(out[pair + h], logarithms[pair + h]);
    }
}
