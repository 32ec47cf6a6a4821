//! Polynomials of degree three by nested multiplication (Horner's scheme): one fused multiply-add a coefficient and no
//! monomials, with every intermediate value in a register.
//!
//! Eight polynomials go together. For many points a vector holds points, for one point it holds polynomials; both
//! ways run through the same scheme, so they give the same bits.

use pulp::Simd;

use super::forms::PAIR;

/// Coordinates evaluated together.
pub(super) const BLOCK: usize = 8;

/// One coefficient of each polynomial of a block.
pub(super) type Row = [f64; BLOCK];

/// Sums of polynomials of a block: of some at several points, or of all at one.
pub(super) trait Sums {
    /// A variable.
    type Variable: Copy;
    /// The sums.
    type Sum: Copy;
    /// Sums that begin with a coefficient.
    fn constant(&self, c: &Row) -> Self::Sum;
    /// `sum + z t`.
    fn add(&self, sum: Self::Sum, z: Self::Variable, t: Self::Sum) -> Self::Sum;
    /// `sum + z c`, where the last `zeros` of `c` are 0 and may be left out.
    fn add_row(&self, sum: Self::Sum, z: Self::Variable, c: &Row, zeros: usize) -> Self::Sum;
}

/// Two vectors of points; the polynomials `FIRST` and `FIRST` + 1 of a block.
pub(super) struct Points<S, const FIRST: usize>(pub S);

impl<S: Simd, const FIRST: usize> Sums for Points<S, FIRST> {
    type Variable = [S::f64s; PAIR];
    type Sum = [[S::f64s; PAIR]; PAIR];

    #[inline(always)]
    fn constant(&self, c: &Row) -> Self::Sum {
        let c = |k: usize| self.0.splat_f64s(c[FIRST + k]);
        [[c(0); PAIR], [c(1); PAIR]]
    }

    #[inline(always)]
    fn add(&self, mut sum: Self::Sum, z: Self::Variable, t: Self::Sum) -> Self::Sum {
        for k in 0..PAIR {
            for v in 0..PAIR {
                sum[k][v] = self.0.mul_add_e_f64s(z[v], t[k][v], sum[k][v]);
            }
        }
        sum
    }

    #[inline(always)]
    fn add_row(&self, mut sum: Self::Sum, z: Self::Variable, c: &Row, zeros: usize) -> Self::Sum {
        for k in 0..PAIR {
            if FIRST + k < BLOCK - zeros {
                let c = self.0.splat_f64s(c[FIRST + k]);
                for v in 0..PAIR {
                    sum[k][v] = self.0.mul_add_e_f64s(z[v], c, sum[k][v]);
                }
            }
        }
        sum
    }
}

/// One point; vectors of polynomials, of which the first that make a block are used.
pub(super) struct Point<S>(pub S);

impl<S: Simd> Sums for Point<S> {
    type Variable = S::f64s;
    type Sum = [S::f64s; BLOCK];

    #[inline(always)]
    fn constant(&self, c: &Row) -> Self::Sum {
        let mut sum = [self.0.splat_f64s(0.0); BLOCK];
        let (c, _) = S::as_simd_f64s(c);
        sum[..BLOCK / S::F64_LANES].copy_from_slice(&c[..BLOCK / S::F64_LANES]);
        sum
    }

    #[inline(always)]
    fn add(&self, mut sum: Self::Sum, z: Self::Variable, t: Self::Sum) -> Self::Sum {
        for k in 0..BLOCK / S::F64_LANES {
            sum[k] = self.0.mul_add_e_f64s(z, t[k], sum[k]);
        }
        sum
    }

    #[inline(always)]
    fn add_row(&self, mut sum: Self::Sum, z: Self::Variable, c: &Row, _zeros: usize) -> Self::Sum {
        let (c, _) = S::as_simd_f64s(c);
        for k in 0..BLOCK / S::F64_LANES {
            sum[k] = self.0.mul_add_e_f64s(z, c[k], sum[k]);
        }
        sum
    }
}

/// Where the scheme is among the coefficients, and how many of the next row of degree three are 0.
struct Place {
    at: usize,
    zeros: usize,
}

impl Place {
    #[inline(always)]
    fn next<'a, const N: usize>(&mut self, c: &'a [Row; N]) -> &'a Row {
        self.at += 1;
        &c[self.at - 1]
    }
}

/// c + sum of c_k z_k over the variables k >= `FROM`.
#[inline(always)]
fn linear<A: Sums, const FROM: usize, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
    place: &mut Place,
) -> A::Sum {
    let mut sum = a.constant(place.next(c));
    for z in &z[FROM..] {
        sum = a.add_row(sum, *z, place.next(c), place.zeros);
        place.zeros = place.zeros.saturating_sub(1);
    }
    sum
}

/// The same with a linear polynomial of the variables from k on in place of each c_k. Written out, because a loop of
/// such bodies is not unrolled.
#[inline(always)]
fn bilinear<A: Sums, const FROM: usize, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
    place: &mut Place,
) -> A::Sum {
    let mut sum = a.constant(place.next(c));
    if FROM == 0 {
        sum = a.add(sum, z[0], linear::<A, 0, V, N>(a, z, c, place));
    }
    if FROM <= 1 {
        sum = a.add(sum, z[1], linear::<A, 1, V, N>(a, z, c, place));
    }
    if FROM <= 2 && V > 2 {
        sum = a.add(sum, z[2], linear::<A, 2, V, N>(a, z, c, place));
    }
    if FROM <= 3 && V > 3 {
        sum = a.add(sum, z[3], linear::<A, 3, V, N>(a, z, c, place));
    }
    sum
}

/// Polynomials of degree two in two to four variables.
#[inline(always)]
pub(super) fn quadratic<A: Sums, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
) -> A::Sum {
    bilinear::<A, 0, V, N>(a, z, c, &mut Place { at: 0, zeros: 0 })
}

/// Polynomials of degree three in two to four variables, where row m of the coefficients of degree three has m + 1
/// numbers before the zeros.
#[inline(always)]
pub(super) fn cubic<A: Sums, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
) -> A::Sum {
    let place = &mut Place {
        at: 0,
        zeros: BLOCK - 1,
    };
    let mut sum = a.constant(place.next(c));
    sum = a.add(sum, z[0], bilinear::<A, 0, V, N>(a, z, c, place));
    sum = a.add(sum, z[1], bilinear::<A, 1, V, N>(a, z, c, place));
    if V > 2 {
        sum = a.add(sum, z[2], bilinear::<A, 2, V, N>(a, z, c, place));
    }
    if V > 3 {
        sum = a.add(sum, z[3], bilinear::<A, 3, V, N>(a, z, c, place));
    }
    sum
}

/// Exponents in the scheme's order for polynomials of a degree.
pub(super) fn order(variables: usize, degree: usize) -> Vec<Vec<u8>> {
    fn below(e: &[u8], from: usize, degree: usize, all: &mut Vec<Vec<u8>>) {
        all.push(e.to_vec());
        for k in (from..e.len()).filter(|_| degree > 0) {
            let mut next = e.to_vec();
            next[k] += 1;
            below(&next, k, degree - 1, all);
        }
    }
    let mut all = Vec::new();
    below(&vec![0; variables], 0, degree, &mut all);
    all
}
