//! Polynomials of degree three by nested multiplication (Horner's scheme): one fused multiply-add a coefficient and no
//! monomials, with every intermediate value in a register.
//!
//! Eight polynomials go together. For many points a vector holds points, for one point it holds polynomials; both
//! ways run through the same scheme, so they give the same bits.

use pulp::Simd;

/// Coordinates evaluated together.
pub(super) const BLOCK: usize = 8;

/// One coefficient of each polynomial of a block.
pub(super) type Row = [f64; BLOCK];

/// Sums of a block of polynomials: at several points, or at one.
pub(super) trait Sums {
    /// A variable.
    type Variable: Copy;
    /// The sums.
    type Sum: Copy;
    /// How many numbers of a sum are used.
    const USED: usize;
    /// Sums that begin with a coefficient.
    fn constant(&self, c: &Row) -> Self::Sum;
    /// `sum + z t`.
    fn add(&self, sum: Self::Sum, z: Self::Variable, t: Self::Sum) -> Self::Sum;
    /// `sum + z c`, where the last `zeros` of `c` are 0 and left out.
    fn add_row(&self, sum: Self::Sum, z: Self::Variable, c: &Row, zeros: usize) -> Self::Sum;
}

/// A vector of points; the `G` polynomials of a block from `first` on.
pub(super) struct Points<S, const G: usize> {
    pub simd: S,
    pub first: usize,
}

impl<S: Simd, const G: usize> Sums for Points<S, G> {
    type Variable = S::f64s;
    type Sum = [S::f64s; G];
    const USED: usize = G;

    #[inline(always)]
    fn constant(&self, c: &Row) -> Self::Sum {
        let mut sum = [self.simd.splat_f64s(0.0); G];
        for k in 0..G {
            sum[k] = self.simd.splat_f64s(c[self.first + k]);
        }
        sum
    }

    #[inline(always)]
    fn add(&self, mut sum: Self::Sum, z: S::f64s, t: Self::Sum) -> Self::Sum {
        for k in 0..G {
            sum[k] = self.simd.mul_add_e_f64s(z, t[k], sum[k]);
        }
        sum
    }

    #[inline(always)]
    fn add_row(&self, mut sum: Self::Sum, z: S::f64s, c: &Row, zeros: usize) -> Self::Sum {
        for k in 0..G {
            if self.first + k < BLOCK - zeros {
                let c = self.simd.splat_f64s(c[self.first + k]);
                sum[k] = self.simd.mul_add_e_f64s(z, c, sum[k]);
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
    const USED: usize = BLOCK / S::F64_LANES;

    #[inline(always)]
    fn constant(&self, c: &Row) -> Self::Sum {
        let mut sum = [self.0.splat_f64s(0.0); BLOCK];
        let (c, _) = S::as_simd_f64s(c);
        sum[..BLOCK / S::F64_LANES].copy_from_slice(&c[..BLOCK / S::F64_LANES]);
        sum
    }

    #[inline(always)]
    fn add(&self, mut sum: Self::Sum, z: S::f64s, t: Self::Sum) -> Self::Sum {
        for k in 0..BLOCK / S::F64_LANES {
            sum[k] = self.0.mul_add_e_f64s(z, t[k], sum[k]);
        }
        sum
    }

    #[inline(always)]
    fn add_row(&self, mut sum: Self::Sum, z: S::f64s, c: &Row, _zeros: usize) -> Self::Sum {
        let (c, _) = S::as_simd_f64s(c);
        for k in 0..BLOCK / S::F64_LANES {
            sum[k] = self.0.mul_add_e_f64s(z, c[k], sum[k]);
        }
        sum
    }
}

/// Where the scheme is among the coefficients, and how many of the next row of degree three are 0.
pub(super) struct Place {
    pub at: usize,
    pub zeros: usize,
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
pub(super) fn quadratic<A: Sums, const FROM: usize, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
    place: &mut Place,
) -> A::Sum {
    let mut sum = a.constant(place.next(c));
    if FROM == 0 {
        sum = a.add(sum, z[0], linear::<A, 0, V, N>(a, z, c, place));
    }
    if FROM <= 1 && V > 1 {
        sum = a.add(sum, z[1], linear::<A, 1, V, N>(a, z, c, place));
    }
    if FROM <= 2 && V > 2 {
        sum = a.add(sum, z[2], linear::<A, 2, V, N>(a, z, c, place));
    }
    if FROM <= 3 && V > 3 {
        sum = a.add(sum, z[3], linear::<A, 3, V, N>(a, z, c, place));
    }
    if FROM <= 4 && V > 4 {
        sum = a.add(sum, z[4], linear::<A, 4, V, N>(a, z, c, place));
    }
    sum
}

/// The same with quadratic polynomials.
#[inline(always)]
pub(super) fn cubic<A: Sums, const V: usize, const N: usize>(
    a: &A,
    z: &[A::Variable; V],
    c: &[Row; N],
    zeros: usize,
) -> A::Sum {
    let place = &mut Place { at: 0, zeros };
    let mut sum = a.constant(place.next(c));
    sum = a.add(sum, z[0], quadratic::<A, 0, V, N>(a, z, c, place));
    if V > 1 {
        sum = a.add(sum, z[1], quadratic::<A, 1, V, N>(a, z, c, place));
    }
    if V > 2 {
        sum = a.add(sum, z[2], quadratic::<A, 2, V, N>(a, z, c, place));
    }
    if V > 3 {
        sum = a.add(sum, z[3], quadratic::<A, 3, V, N>(a, z, c, place));
    }
    if V > 4 {
        sum = a.add(sum, z[4], quadratic::<A, 4, V, N>(a, z, c, place));
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
