//! The evidence of parts of a mixture at many points: normal equations added up and eliminated for a vector of points at a time. Sampling
//! the posterior to quote is nearly all spent here.

use pulp::{Simd, WithSimd};

use super::equations::Equations;
use super::space::monomials;
use crate::lanes::ln_vector;

/// [`Equations`] in directions of unit prior: every number's coefficients beside each other.
#[derive(Clone)]
pub struct Compiled {
    directions: usize,
    /// Number of factors of what the data leave.
    factors: usize,
    /// Lower triangle of G, column after column, in the monomials.
    gram: Vec<f64>,
    /// z, in the factors times 1 and each coordinate.
    right: Vec<f64>,
    /// Of r, in the factors twice.
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
            factors: equations.rest.nrows(),
            gram: interleaved(&below.map(gram).collect::<Vec<Vec<f64>>>()),
            right: interleaved(&(0..n).map(right).collect::<Vec<Vec<f64>>>()),
            rest: interleaved(&rest.collect::<Vec<Vec<f64>>>()),
        }
    }

    /// Vectors of room that [`Self::evidence`] needs.
    fn room(&self) -> usize {
        let n = self.directions;
        [self.factors, n, n * (n + 1) / 2]
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
        let (rest, gram) = room.split_at_mut(whole(self.factors));
        sums(simd, &self.gram, powers.monomials, gram);
        sums(simd, &self.right, powers.products, right);
        sums(simd, &self.rest, powers.factors, rest);
        for sum in gram.iter_mut().chain(&mut *right).chain(&mut *rest) {
            *sum = simd.mul_f64s(*sum, powers.precision);
        }
        let mut square = zero;
        for (by, m) in rest.iter().zip(powers.factors) {
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

/// Of a vector of points: monomials of their coordinates, the factors of what the data leave, and the products of these with 1 and each
/// coordinate.
#[derive(Clone, Copy)]
struct Powers<'a, S: Simd> {
    monomials: &'a [S::f64s],
    factors: &'a [S::f64s],
    products: &'a [S::f64s],
    precision: S::f64s,
}

/// Coordinates of the constants, and the factors of what the data leave there.
type PointFactors = (Vec<f64>, Vec<f64>);

/// Places of some points: coordinates of the constants, 1 first, and factors of what the data leave; one row for each, a number a point.
pub struct PlacesOf {
    pub coordinates: Vec<Vec<f64>>,
    pub factors: Vec<Vec<f64>>,
    /// By which the noise's precision differs, a number a point.
    pub precision: Vec<f64>,
}

impl PlacesOf {
    /// Of points one by one.
    pub fn new(points: &[PointFactors], precision: Vec<f64>) -> Self {
        let rows = |of: &dyn Fn(&PointFactors) -> Vec<f64>| -> Vec<Vec<f64>> {
            let all: Vec<Vec<f64>> = points.iter().map(of).collect();
            let count = all.first().map_or(0, Vec::len);
            let row = |k: usize| all.iter().map(|p| p[k]).collect();
            (0..count).map(row).collect()
        };
        Self {
            coordinates: rows(&|p| p.0.clone()),
            factors: rows(&|p| p.1.clone()),
            precision,
        }
    }

    fn count(&self) -> usize {
        self.coordinates.first().map_or(0, Vec::len)
    }
}

/// Log evidence of every part at every place, part by part: the coefficients of one stay near the processor while all places have them.
pub fn log_evidences(parts: &[&Compiled], places: &PlacesOf) -> Vec<f64> {
    let mut out = vec![0.0; parts.len() * places.count()];
    if !out.is_empty() {
        pulp::Arch::new().dispatch(EvidenceBatch {
            parts,
            places,
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
    places: &'a PlacesOf,
    out: &'a mut [f64],
}

impl WithSimd for EvidenceBatch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Some(first) = self.parts.first() else {
            return;
        };
        let PlacesOf {
            coordinates,
            factors,
            precision,
        } = self.places;
        let count = self.places.count();
        let pairs = monomials(coordinates.len() - 1);
        let each = pairs.len() + factors.len() * (1 + coordinates.len());
        let vectors = count.div_ceil(S::F64_LANES);
        let mut powers = vec![0.0; vectors * each * S::F64_LANES];
        let (powers, _) = S::as_mut_simd_f64s(&mut powers);
        let own = |v: usize| v * S::F64_LANES..count.min((v + 1) * S::F64_LANES);
        for (v, powers) in powers.chunks_exact_mut(each).enumerate() {
            let (m, rest) = powers.split_at_mut(pairs.len());
            let (left, products) = rest.split_at_mut(factors.len());
            let of = |row: &Vec<f64>| simd.partial_load_f64s(&row[own(v)]);
            for (m, [a, b]) in m.iter_mut().zip(&pairs) {
                *m = simd.mul_f64s(of(&coordinates[*a]), of(&coordinates[*b]));
            }
            for (left, row) in left.iter_mut().zip(factors) {
                *left = of(row);
            }
            for (products, row) in products.chunks_exact_mut(factors.len()).zip(coordinates) {
                let x = of(row);
                for (product, left) in products.iter_mut().zip(&*left) {
                    *product = simd.mul_f64s(*left, x);
                }
            }
        }
        let mut room = vec![0.0; first.room() * S::F64_LANES];
        let (room, _) = S::as_mut_simd_f64s(&mut room);
        for (part, out) in self.parts.iter().zip(self.out.chunks_exact_mut(count)) {
            for (v, powers) in powers.chunks_exact(each).enumerate() {
                let (monomials, rest) = powers.split_at(pairs.len());
                let (factors, products) = rest.split_at(factors.len());
                let powers = Powers {
                    monomials,
                    factors,
                    products,
                    precision: simd.partial_load_f64s(&precision[own(v)]),
                };
                let value = part.evidence(simd, powers, room);
                simd.partial_store_f64s(&mut out[own(v)], value);
            }
        }
    }
}
