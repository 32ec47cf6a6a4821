//! Quadratic forms of polynomials of degree three in up to [`MOST`] variables, evaluated by nested multiplication.

use nalgebra::DMatrix;
use pulp::{Scalar, Simd};

use super::forms::{Alone, Finish, Forms, GROUP, Of, Residual};
use super::lanes::{Lanes, Parameters, WIDTH};
use super::monomials::{Variable, position};
use super::nested::{BLOCK, Place, Point, Points, Row, Sums, cubic, order, quadratic};

/// Most variables.
pub(super) const MOST: usize = 5;

/// What the quadratic form is made of, in coordinates whose covariance is diagonal.
pub(super) struct Form<'a> {
    /// Exponents of the columns' monomials.
    pub exponents: &'a [Vec<u8>],
    /// Mean: the coefficients of each monomial in all coordinates.
    pub mean: &'a [Vec<f64>],
    /// Thickness response over the first monomials, or none.
    pub slope: Option<&'a [Vec<f64>]>,
    /// Without slope: response relative to the mean.
    pub relative: f64,
    /// Measured coordinates.
    pub measured: &'a [f64],
    /// Growth of each variance with the noise's; empty if all variances are 1.
    pub spread: &'a [f64],
    /// The variables.
    pub variables: &'a [Variable],
    /// What over the first parameter stands before the polynomials, if anything does.
    pub factor: Option<f64>,
}

/// Eight coordinates.
#[derive(Debug, Clone)]
struct Block {
    /// Coefficients of the mean in the scheme's order; of the residual if that is all that is needed.
    mean: Vec<Row>,
    /// Coefficients of the response, of degree two; empty if it is 0 or a multiple of the mean.
    slope: Vec<Row>,
    measured: Row,
    spread: Row,
}

/// Quadratic forms of cubic polynomials.
#[derive(Debug, Clone)]
pub(super) struct Horner {
    variables: Vec<Variable>,
    factor: Option<f64>,
    blocks: Vec<Block>,
    /// Response relative to the mean, where it has no polynomials of its own.
    relative: Option<f64>,
    /// `mean` of the blocks is the residual.
    residual: bool,
    /// Variances are 1, and the coordinates of a block rotated so that some coefficients vanish.
    unit: bool,
}

impl Horner {
    /// None if the polynomials are of another kind.
    pub(super) fn new(form: &Form<'_>) -> Option<Self> {
        let variables = form.exponents.first()?.len();
        let degree = |e: &[u8]| e.iter().map(|k| usize::from(*k)).sum::<usize>();
        let slope = form.slope.unwrap_or_default();
        let bent = form.exponents.iter().any(|e| degree(e) > 3);
        let steep = form.exponents[..slope.len()].iter().any(|e| degree(e) > 2);
        if bent || steep || !(1..=MOST).contains(&variables) {
            return None;
        }
        let residual = form.factor.is_none() && form.slope.is_some();
        let unit = form.spread.is_empty();
        let row = |column: Option<&Vec<f64>>, first: usize| -> Row {
            let mut row = [0.0; BLOCK];
            for (to, from) in row.iter_mut().zip(column.iter().flat_map(|c| &c[first..])) {
                *to = *from;
            }
            row
        };
        let padded =
            |values: &[f64], first: usize| row(Some(&values.to_vec()), first.min(values.len()));
        let rows = |columns: &[Vec<f64>], degree: usize, first: usize| -> Vec<Row> {
            let wanted = order(variables, degree);
            let found = wanted.iter().map(|e| {
                let at = position(form.exponents, e);
                let there = form.exponents.get(at).is_some_and(|x| x == e);
                row(columns.get(at).filter(|_| there), first)
            });
            found.collect()
        };
        let blocks = (0..form.measured.len()).step_by(BLOCK).map(|first| {
            let mut block = Block {
                mean: rows(form.mean, 3, first),
                slope: if slope.iter().flatten().all(|c| *c == 0.0) {
                    Vec::new()
                } else {
                    rows(slope, 2, first)
                },
                measured: padded(form.measured, first),
                spread: padded(form.spread, first),
            };
            if residual {
                block.mean.iter_mut().flatten().for_each(|c| *c = -*c);
                for (c, m) in block.mean[0].iter_mut().zip(block.measured) {
                    *c += m;
                }
            }
            if unit {
                block.rotate(variables);
            }
            block
        });
        Some(Self {
            variables: form.variables.to_vec(),
            factor: form.factor,
            blocks: blocks.collect(),
            relative: form.slope.is_none().then_some(form.relative),
            residual,
            unit,
        })
    }

    /// What `finish` makes of the forms at the first `count` of `points`, whose noise has the scales `scale`.
    #[inline(always)]
    pub(super) fn batch<S: Simd>(
        &self,
        simd: S,
        points: &[Lanes],
        count: usize,
        scale: &Lanes,
        finish: &impl Finish<S>,
    ) -> Lanes {
        let mut out = [0.0; WIDTH];
        match self.variables.len() {
            1 => self.points::<S, 1, 4, 3>(simd, points, count, scale, finish, &mut out),
            2 => self.points::<S, 2, 10, 6>(simd, points, count, scale, finish, &mut out),
            3 => self.points::<S, 3, 20, 10>(simd, points, count, scale, finish, &mut out),
            4 => self.points::<S, 4, 35, 15>(simd, points, count, scale, finish, &mut out),
            _ => self.points::<S, 5, 56, 21>(simd, points, count, scale, finish, &mut out),
        }
        out
    }

    #[inline(always)]
    fn points<S: Simd, const V: usize, const N: usize, const M: usize>(
        &self,
        simd: S,
        points: &[Lanes],
        count: usize,
        scale: &Lanes,
        finish: &impl Finish<S>,
        out: &mut Lanes,
    ) {
        let used = count.div_ceil(S::F64_LANES);
        for (v, out) in S::as_mut_simd_f64s(out).0.iter_mut().take(used).enumerate() {
            let x = Of(points, v);
            let (z, factor) = self.scaled::<S, V>(simd, &x);
            let scale = S::as_simd_f64s(scale).0[v];
            let of = [factor, simd.mul_f64s(scale, scale)];
            let mut forms = Forms::zero(simd);
            for block in &self.blocks {
                // As many polynomials at a time as the registers hold with what they are made of.
                if S::REGISTER_COUNT >= 32 {
                    let a = Points::<S, BLOCK> { simd, first: 0 };
                    let residual = self.residual::<S, _, V, N, M, BLOCK>(simd, &a, block, &z, of);
                    forms.add(simd, &residual, self.unit);
                } else {
                    for first in [0, GROUP] {
                        let a = Points::<S, GROUP> { simd, first };
                        let residual =
                            self.residual::<S, _, V, N, M, GROUP>(simd, &a, block, &z, of);
                        forms.add(simd, &residual, self.unit);
                    }
                }
            }
            *out = finish.finish(simd, &x, scale, &forms);
        }
    }

    /// Scaled variables, and the factor before the polynomials.
    #[inline(always)]
    fn scaled<S: Simd, const V: usize>(
        &self,
        simd: S,
        x: &impl Parameters<S>,
    ) -> ([S::f64s; V], S::f64s) {
        let one = simd.splat_f64s(1.0);
        let mut z = [one; V];
        if let Some(variables) = self.variables.first_chunk::<V>() {
            for k in 0..V {
                let v = &variables[k];
                let mut value = x.get(simd, v.numerator);
                if v.ratio {
                    value = simd.div_f64s(value, x.get(simd, 0));
                }
                let distance = simd.sub_f64s(value, simd.splat_f64s(v.middle));
                z[k] = simd.mul_f64s(distance, simd.splat_f64s(v.per_half));
            }
        }
        match self.factor {
            Some(f) => (z, simd.div_f64s(simd.splat_f64s(f), x.get(simd, 0))),
            None => (z, one),
        }
    }

    /// The same as [`Horner::batch`] at one point.
    #[inline(always)]
    pub(super) fn single<S: Simd>(&self, simd: S, x: &[f64], variance: f64) -> Forms<f64> {
        match self.variables.len() {
            1 => self.point::<S, 1, 4, 3>(simd, x, variance),
            2 => self.point::<S, 2, 10, 6>(simd, x, variance),
            3 => self.point::<S, 3, 20, 10>(simd, x, variance),
            4 => self.point::<S, 4, 35, 15>(simd, x, variance),
            _ => self.point::<S, 5, 56, 21>(simd, x, variance),
        }
    }

    #[inline(always)]
    fn point<S: Simd, const V: usize, const N: usize, const M: usize>(
        &self,
        simd: S,
        x: &[f64],
        variance: f64,
    ) -> Forms<f64> {
        let scalar = Scalar::new();
        let (scaled, factor) = self.scaled::<_, V>(scalar, &Alone(x));
        let mut z = [simd.splat_f64s(0.0); V];
        for k in 0..V {
            z[k] = simd.splat_f64s(scaled[k]);
        }
        let of = [simd.splat_f64s(factor), simd.splat_f64s(variance)];
        let a = Point(simd);
        let mut forms = Forms::zero(scalar);
        for block in &self.blocks {
            let along = self.residual::<S, _, V, N, M, BLOCK>(simd, &a, block, &z, of);
            let mut across = Residual {
                terms: [[0.0; BLOCK]; 3],
                variance: [1.0; BLOCK],
            };
            for (across, along) in across.terms.iter_mut().zip(&along.terms) {
                lay_out::<S>(along, across);
            }
            if !self.unit {
                lay_out::<S>(&along.variance, &mut across.variance);
            }
            forms.add(scalar, &across, self.unit);
        }
        forms
    }

    /// What a block's coordinates give, whether a vector holds points or coordinates.
    #[inline(always)]
    fn residual<S, A, const V: usize, const N: usize, const M: usize, const G: usize>(
        &self,
        simd: S,
        a: &A,
        block: &Block,
        z: &[S::f64s; V],
        [factor, variance]: [S::f64s; 2],
    ) -> Residual<S::f64s, G>
    where
        S: Simd,
        A: Sums<Variable = S::f64s, Sum = [S::f64s; G]>,
    {
        let one = simd.splat_f64s(1.0);
        let (mut r, mut w) = ([one; G], [simd.splat_f64s(0.0); G]);
        if let Some(c) = block.mean.first_chunk::<N>() {
            // Known to the compiler, so that nothing is asked in between.
            r = if self.unit {
                cubic::<_, V, N>(a, z, c, BLOCK - 1)
            } else {
                cubic::<_, V, N>(a, z, c, 0)
            };
        }
        if let Some(c) = block.slope.first_chunk::<M>() {
            w = quadratic::<_, 0, V, M>(a, z, c, &mut Place { at: 0, zeros: 0 });
        }
        if !self.residual {
            let measured = a.constant(&block.measured);
            for k in 0..A::USED {
                let mean = simd.mul_f64s(factor, r[k]);
                r[k] = simd.sub_f64s(measured[k], mean);
                if let Some(relative) = self.relative {
                    w[k] = simd.mul_f64s(simd.splat_f64s(relative), mean);
                }
            }
        }
        let (mut rv, mut wv, mut v) = (r, w, [one; G]);
        if !self.unit {
            let spread = a.constant(&block.spread);
            for k in 0..A::USED {
                v[k] = simd.mul_add_e_f64s(variance, spread[k], one);
                let inverse = simd.div_f64s(one, v[k]);
                rv[k] = simd.mul_f64s(r[k], inverse);
                wv[k] = simd.mul_f64s(w[k], inverse);
            }
        }
        let mut terms = [[one; G]; 3];
        for k in 0..A::USED {
            terms[0][k] = simd.mul_f64s(r[k], rv[k]);
            terms[1][k] = simd.mul_f64s(w[k], wv[k]);
            terms[2][k] = simd.mul_f64s(w[k], rv[k]);
        }
        Residual { terms, variance: v }
    }
}

/// A block's numbers out of the first vectors.
#[inline(always)]
fn lay_out<S: Simd>(vectors: &[S::f64s; BLOCK], out: &mut Row) {
    S::as_mut_simd_f64s(out)
        .0
        .copy_from_slice(&vectors[..BLOCK / S::F64_LANES]);
}

impl Block {
    /// Rotates the coordinates, whose variances are 1, so that of the first coefficients of degree three each row has
    /// one number more than the row before, instead of all eight (a QR factorisation).
    fn rotate(&mut self, variables: usize) {
        let order = order(variables, 3);
        let degree = |e: &Vec<u8>| e.iter().map(|k| usize::from(*k)).sum::<usize>();
        let high: Vec<usize> = (0..order.len())
            .filter(|m| degree(&order[*m]) == 3)
            .collect();
        let high = &high[..high.len().min(BLOCK - 1)];
        let matrix = DMatrix::from_fn(BLOCK, BLOCK, |k, m| {
            high.get(m).map_or(0.0, |row| self.mean[*row][k])
        });
        let rotation = matrix.qr().q();
        let turn = |row: &mut Row| {
            let old = *row;
            for (k, value) in row.iter_mut().enumerate() {
                *value = (0..BLOCK).map(|i| rotation[(i, k)] * old[i]).sum();
            }
        };
        self.mean.iter_mut().chain(&mut self.slope).for_each(turn);
        turn(&mut self.measured);
        for (m, row) in high.iter().enumerate() {
            self.mean[*row][m + 1..].fill(0.0);
        }
    }
}
