//! Quadratic forms of polynomials of degree three in two to four variables, evaluated by nested multiplication. The
//! coordinates have unit variance: the polynomials are those of the residual and of the thickness response themselves.

use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

use super::forms::{Finish, Forms, Of, PAIR};
use super::lanes::{Columns, Parameters};
use super::monomials::{Variable, degree, position};
use super::nested::{BLOCK, Point, Points, Row, cubic, order, quadratic};

/// What the quadratic form is made of.
pub(super) struct Form<'a> {
    /// Exponents of the columns' monomials.
    pub exponents: &'a [Vec<u8>],
    /// Mean: the coefficients of each monomial in all coordinates.
    pub mean: &'a [Vec<f64>],
    /// Thickness response over the first monomials.
    pub slope: &'a [Vec<f64>],
    /// Measured coordinates.
    pub measured: &'a [f64],
    /// The variables.
    pub variables: &'a [Variable],
}

/// Eight coordinates.
#[derive(Debug, Clone)]
struct Block {
    /// Coefficients of the residual in the scheme's order.
    residual: Vec<Row>,
    /// Coefficients of the response, of degree two.
    response: Vec<Row>,
}

/// Where a variable is among the parameters, and where it is 0.
#[derive(Debug, Clone)]
struct Centred {
    at: usize,
    middle: f64,
}

/// Quadratic forms of cubic polynomials.
#[derive(Debug, Clone)]
pub(super) struct Horner {
    variables: Vec<Centred>,
    blocks: Vec<Block>,
}

impl Horner {
    /// None if the polynomials are of another kind.
    pub(super) fn new(form: &Form<'_>) -> Option<Self> {
        let variables = form.exponents.first()?.len();
        let bent = form.exponents.iter().any(|e| degree(e) > 3);
        let slope = &form.exponents[..form.slope.len()];
        let steep = slope.iter().any(|e| degree(e) > 2);
        let ratio = form.variables.iter().any(|v| v.ratio);
        if bent || steep || ratio || !(2..=4).contains(&variables) {
            return None;
        }
        let rows = |columns: &[Vec<f64>], degree: usize, first: usize| -> Vec<Row> {
            let wanted = order(variables, degree);
            let found = wanted.iter().map(|e| {
                let mut row = [0.0; BLOCK];
                let at = position(form.exponents, e);
                if form.exponents.get(at) == Some(e)
                    && let Some(column) = columns.get(at)
                {
                    // The variables' scale goes into the coefficients.
                    let powers = form.variables.iter().zip(e);
                    let scale: f64 = powers
                        .map(|(v, e)| v.per_half.powi(i32::from(*e)))
                        .product();
                    for (to, from) in row.iter_mut().zip(&column[first..]) {
                        *to = scale * from;
                    }
                }
                row
            });
            found.collect()
        };
        let blocks = (0..form.measured.len()).step_by(BLOCK).map(|first| {
            let mut block = Block {
                residual: rows(form.mean, 3, first),
                response: rows(form.slope, 2, first),
            };
            block.residual.iter_mut().flatten().for_each(|c| *c = -*c);
            for (c, m) in block.residual[0].iter_mut().zip(&form.measured[first..]) {
                *c += m;
            }
            block.rotate(variables);
            block
        });
        let centred = form.variables.iter().map(|v| Centred {
            at: v.numerator,
            middle: v.middle,
        });
        Some(Self {
            variables: centred.collect(),
            blocks: blocks.collect(),
        })
    }

    /// What `finish` makes of the forms at the points, for as many as `out` has, a multiple of
    /// [`super::lanes::WIDTH`].
    #[inline(always)]
    pub(super) fn batch<S: Simd>(
        &self,
        simd: S,
        points: Columns<'_>,
        finish: &impl Finish,
        out: &mut [f64],
    ) {
        let work = (self, points, finish);
        match self.variables.len() {
            2 => simd.vectorize(Pairs::<_, 2, 10, 6>(work, out)),
            3 => simd.vectorize(Pairs::<_, 3, 20, 10>(work, out)),
            _ => simd.vectorize(Pairs::<_, 4, 35, 15>(work, out)),
        }
    }

    /// The forms at one point, in every lane.
    #[inline(always)]
    pub(super) fn single<S: Simd>(&self, simd: S, x: &[f64]) -> Forms<S::f64s> {
        match self.variables.len() {
            2 => self.point::<S, 2, 10, 6>(simd, x),
            3 => self.point::<S, 3, 20, 10>(simd, x),
            _ => self.point::<S, 4, 35, 15>(simd, x),
        }
    }

    #[inline(always)]
    fn point<S: Simd, const V: usize, const N: usize, const M: usize>(
        &self,
        simd: S,
        x: &[f64],
    ) -> Forms<S::f64s> {
        let mut forms = Forms::zero(simd);
        let mut z = [simd.splat_f64s(0.0); V];
        for (z, v) in z.iter_mut().zip(&self.variables) {
            *z = simd.splat_f64s(x[v.at] - v.middle);
        }
        for block in &self.blocks {
            let Some((residual, response)) = block.rows::<N, M>() else {
                break;
            };
            let a = Point(simd);
            let r = lay_out::<S>(&cubic::<_, V, N>(&a, &z, residual));
            let w = lay_out::<S>(&quadratic::<_, V, M>(&a, &z, response));
            for (r, w) in r.iter().zip(&w) {
                forms.add(simd, simd.splat_f64s(*r), simd.splat_f64s(*w));
            }
        }
        forms
    }
}

/// Points by pairs of vectors. A function of its own for each number of variables: all in one leave the compiler without
/// registers.
struct Pairs<'a, F, const V: usize, const N: usize, const M: usize>(
    (&'a Horner, Columns<'a>, &'a F),
    &'a mut [f64],
);

impl<F: Finish, const V: usize, const N: usize, const M: usize> WithSimd for Pairs<'_, F, V, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self((horner, points, finish), out) = self;
        let Some(variables) = horner.variables.first_chunk::<V>() else {
            return;
        };
        let (out, _) = S::as_mut_simd_f64s(out);
        for (pair, out) in out.chunks_exact_mut(PAIR).enumerate() {
            let of = [Of(points, PAIR * pair), Of(points, PAIR * pair + 1)];
            let mut z = [[simd.splat_f64s(0.0); PAIR]; V];
            for (z, v) in z.iter_mut().zip(variables) {
                let middle = simd.splat_f64s(v.middle);
                for (z, of) in z.iter_mut().zip(&of) {
                    *z = simd.sub_f64s(of.get(simd, v.at), middle);
                }
            }
            let mut sums = [Forms::zero(simd); PAIR];
            for block in &horner.blocks {
                let Some(rows) = block.rows::<N, M>() else {
                    return;
                };
                two::<S, 0, V, N, M>(simd, &z, rows, &mut sums);
                two::<S, 2, V, N, M>(simd, &z, rows, &mut sums);
                two::<S, 4, V, N, M>(simd, &z, rows, &mut sums);
                two::<S, 6, V, N, M>(simd, &z, rows, &mut sums);
            }
            for ((out, of), sums) in out.iter_mut().zip(&of).zip(&sums) {
                *out = finish.finish(simd, of, sums);
            }
        }
    }
}

/// Adds the coordinates `FIRST` and `FIRST` + 1 of a block at two vectors of points: few enough sums for the registers,
/// enough to keep the processor busy, and each coefficient is loaded once for both vectors.
#[inline(always)]
fn two<S: Simd, const FIRST: usize, const V: usize, const N: usize, const M: usize>(
    simd: S,
    z: &[[S::f64s; PAIR]; V],
    (residual, response): (&[Row; N], &[Row; M]),
    sums: &mut [Forms<S::f64s>; PAIR],
) {
    let a = Points::<S, FIRST>(simd);
    let r = cubic::<_, V, N>(&a, z, residual);
    let w = quadratic::<_, V, M>(&a, z, response);
    for v in 0..PAIR {
        for k in 0..PAIR {
            sums[v].add(simd, r[k][v], w[k][v]);
        }
    }
}

/// A block's numbers out of the first vectors.
#[inline(always)]
fn lay_out<S: Simd>(vectors: &[S::f64s; BLOCK]) -> Row {
    let mut row = [0.0; BLOCK];
    S::as_mut_simd_f64s(&mut row)
        .0
        .copy_from_slice(&vectors[..BLOCK / S::F64_LANES]);
    row
}

impl Block {
    /// The coefficients, with their number known to the compiler.
    #[inline(always)]
    fn rows<const N: usize, const M: usize>(&self) -> Option<(&[Row; N], &[Row; M])> {
        self.residual.first_chunk().zip(self.response.first_chunk())
    }

    /// Rotates the coordinates so that of the first coefficients of degree three each row has one number more than the
    /// row before, instead of all eight (a QR factorisation).
    fn rotate(&mut self, variables: usize) {
        let order = order(variables, 3);
        let cubic = (0..order.len()).filter(|m| degree(&order[*m]) == 3);
        let high: Vec<usize> = cubic.take(BLOCK - 1).collect();
        let matrix = DMatrix::from_fn(BLOCK, BLOCK, |k, m| {
            high.get(m).map_or(0.0, |row| self.residual[*row][k])
        });
        let rotation = matrix.qr().q();
        let turn = |row: &mut Row| {
            let old = *row;
            for (k, value) in row.iter_mut().enumerate() {
                *value = (0..BLOCK).map(|i| rotation[(i, k)] * old[i]).sum();
            }
        };
        self.residual
            .iter_mut()
            .chain(&mut self.response)
            .for_each(turn);
        for (m, row) in high.iter().enumerate() {
            self.residual[*row][m + 1..].fill(0.0);
        }
    }
}
