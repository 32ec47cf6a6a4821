//! The evidence of parts of a mixture at many points: normal equations added up and eliminated for a vector of points at a time. Sampling
//! the posterior to quote is nearly all spent here.

use pulp::{Simd, WithSimd};

use super::quadratic::Equations;
use crate::lanes::ln_vector;

/// [`Equations`] in directions of unit prior: every number's coefficients beside each other.
pub struct Compiled {
    directions: usize,
    monomials: Vec<[usize; 2]>,
    /// Lower triangle of G, column after column, in the monomials.
    gram: Vec<f64>,
    /// z, in the monomials times 1 and each distance.
    right: Vec<f64>,
    /// Of r, in monomials twice.
    rest: Vec<f64>,
}

impl Compiled {
    pub fn new(equations: &Equations) -> Self {
        let n = equations.right[0].nrows();
        let below = (0..n).flat_map(|j| (j..n).map(move |i| (i, j)));
        let gram = |at: (usize, usize)| equations.gram.iter().map(|g| g[at]).collect();
        let right = |i: usize| {
            let rows = equations.right.iter().map(|z| z.row(i));
            rows.flat_map(|row| row.iter().copied().collect::<Vec<f64>>())
                .collect()
        };
        let rest = equations
            .rest
            .row_iter()
            .map(|r| r.iter().copied().collect());
        Self {
            directions: n,
            monomials: equations.monomials.clone(),
            gram: interleaved(&below.map(gram).collect::<Vec<Vec<f64>>>()),
            right: interleaved(&(0..n).map(right).collect::<Vec<Vec<f64>>>()),
            rest: interleaved(&rest.collect::<Vec<Vec<f64>>>()),
        }
    }

    /// Vectors of room that [`Self::evidence`] needs.
    fn room(&self) -> usize {
        let n = self.directions;
        [self.monomials.len(), n, n * (n + 1) / 2]
            .map(|k| k.next_multiple_of(TOGETHER))
            .iter()
            .sum()
    }

    /// The logarithm of the evidence, but for a constant, with everything linear under a unit prior integrated out:
    /// -(r - z' P^-1 z + ln |P|) / 2 of P = I + G, or -inf where P is not positive definite.
    #[inline(always)]
    fn evidence<S: Simd>(&self, simd: S, powers: Powers<'_, S>, room: &mut [S::f64s]) -> S::f64s {
        let zero = simd.splat_f64s(0.0);
        let one = simd.splat_f64s(1.0);
        let n = self.directions;
        let whole = |k: usize| k.next_multiple_of(TOGETHER);
        let (right, room) = room.split_at_mut(whole(n));
        let (rest, gram) = room.split_at_mut(whole(self.monomials.len()));
        sums(simd, &self.gram, powers.monomials, gram);
        sums(simd, &self.right, powers.products, right);
        sums(simd, &self.rest, powers.monomials, rest);
        let mut square = zero;
        for (by, m) in rest.iter().zip(powers.monomials) {
            square = simd.mul_add_e_f64s(*by, *m, square);
        }
        let (mut log_det, mut least) = (zero, one);
        let (mut a, mut z) = (gram, &mut right[..n]);
        while let Some((first, later)) = z.split_first_mut() {
            let (column, rest) = a.split_at_mut(later.len() + 1);
            let pivot = simd.add_f64s(column[0], one);
            let column = &column[1..];
            least = simd.min_f64s(pivot, least);
            log_det = simd.add_f64s(log_det, ln_vector(simd, pivot));
            let by = simd.div_f64s(one, pivot);
            let y = simd.mul_f64s(*first, by);
            square = simd.negate_mul_add_e_f64s(y, *first, square);
            for (z, l) in later.iter_mut().zip(column) {
                *z = simd.negate_mul_add_e_f64s(y, *l, *z);
            }
            let mut next = 0;
            for k in 0..column.len() {
                let below = &column[k..];
                let l = simd.mul_f64s(below[0], by);
                for (x, c) in rest[next..].iter_mut().zip(below) {
                    *x = simd.negate_mul_add_e_f64s(l, *c, *x);
                }
                next += below.len();
            }
            (a, z) = (rest, later);
        }
        let value = simd.mul_f64s(simd.splat_f64s(-0.5), simd.add_f64s(square, log_det));
        let none = simd.splat_f64s(f64::NEG_INFINITY);
        simd.select_f64s(simd.less_than_f64s(zero, least), value, none)
    }
}

/// Rows whose sums are added up together: their coefficients lie interleaved.
const TOGETHER: usize = 8;

/// Rows of coefficients, interleaved, with rows of zeros to a whole number of [`TOGETHER`].
fn interleaved(rows: &[Vec<f64>]) -> Vec<f64> {
    let group = |rows: &[Vec<f64>]| -> Vec<f64> {
        let row = |i: usize, j: usize| rows.get(i).map_or(0.0, |r| r[j]);
        let length = rows[0].len();
        (0..length)
            .flat_map(|j| (0..TOGETHER).map(move |i| (i, j)))
            .map(|(i, j)| row(i, j))
            .collect()
    };
    rows.chunks(TOGETHER).flat_map(group).collect()
}

/// Sums of coefficients times what they belong to; `out` has room for whole groups.
#[inline(always)]
fn sums<S: Simd>(simd: S, coefficients: &[f64], of: &[S::f64s], out: &mut [S::f64s]) {
    let groups = coefficients.chunks_exact(TOGETHER * of.len());
    for (group, out) in groups.zip(out.chunks_exact_mut(TOGETHER)) {
        let mut sums = [simd.splat_f64s(0.0); TOGETHER];
        for (row, x) in group.chunks_exact(TOGETHER).zip(of) {
            for (sum, c) in sums.iter_mut().zip(row) {
                *sum = simd.mul_add_e_f64s(simd.splat_f64s(*c), *x, *sum);
            }
        }
        out.copy_from_slice(&sums);
    }
}

/// Monomials of the distances of a vector of points, and their products with 1 and each distance.
#[derive(Clone, Copy)]
struct Powers<'a, S: Simd> {
    monomials: &'a [S::f64s],
    products: &'a [S::f64s],
}

/// Log evidence of every part at every point, part by part: the coefficients of one stay near the processor while all points have them.
/// `distances` lie constant by constant, prior sds.
pub fn log_evidences(parts: &[&Compiled], distances: &[f64], count: usize) -> Vec<f64> {
    let mut out = vec![0.0; parts.len() * count];
    if count > 0 {
        pulp::Arch::new().dispatch(EvidenceBatch {
            parts,
            distances,
            count,
            out: &mut out,
        });
    }
    for value in &mut out {
        if !value.is_finite() {
            *value = f64::NEG_INFINITY;
        }
    }
    out
}

struct EvidenceBatch<'a> {
    parts: &'a [&'a Compiled],
    distances: &'a [f64],
    count: usize,
    out: &'a mut [f64],
}

impl WithSimd for EvidenceBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Some(first) = self.parts.first() else {
            return;
        };
        let constants = self.distances.len() / self.count;
        let monomials = first.monomials.len();
        let each = monomials * (constants + 2);
        let vectors = self.count.div_ceil(S::F64_LANES);
        let mut powers = vec![0.0; vectors * each * S::F64_LANES];
        let (powers, _) = S::as_mut_simd_f64s(&mut powers);
        let own = |v: usize| v * S::F64_LANES..self.count.min((v + 1) * S::F64_LANES);
        for (v, powers) in powers.chunks_exact_mut(each).enumerate() {
            let (m, products) = powers.split_at_mut(monomials);
            // the last vector's missing points lie where the test was linearised
            let distance = |k: usize| match k {
                0 => simd.splat_f64s(1.0),
                k => simd.partial_load_f64s(&self.distances[(k - 1) * self.count..][own(v)]),
            };
            for (m, [a, b]) in m.iter_mut().zip(&first.monomials) {
                *m = simd.mul_f64s(distance(*a), distance(*b));
            }
            for (k, products) in products.chunks_exact_mut(monomials).enumerate() {
                let d = distance(k);
                for (product, m) in products.iter_mut().zip(&*m) {
                    *product = simd.mul_f64s(*m, d);
                }
            }
        }
        let mut room = vec![0.0; first.room() * S::F64_LANES];
        let (room, _) = S::as_mut_simd_f64s(&mut room);
        for (part, out) in self.parts.iter().zip(self.out.chunks_exact_mut(self.count)) {
            for (v, powers) in powers.chunks_exact(each).enumerate() {
                let (monomials, products) = powers.split_at(monomials);
                let powers = Powers {
                    monomials,
                    products,
                };
                let value = part.evidence(simd, powers, room);
                simd.partial_store_f64s(&mut out[own(v)], value);
            }
        }
    }
}
