//! Quadratic forms of polynomials of degree three in up to [`MOST`] variables, evaluated by nested multiplication.

use nalgebra::DMatrix;
use pulp::Simd;

use super::lanes::{Lanes, WIDTH, ln};
use super::monomials::position;
use super::nested::{BLOCK, Place, Point, Points, Row, cubic, order, quadratic};

/// Most variables.
pub(super) const MOST: usize = 5;

/// Coordinates whose product of variances is taken before the logarithm.
pub(super) const GROUP: usize = 4;

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
    /// Whether a factor stands before the polynomials.
    pub factor: bool,
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
    variables: usize,
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
        let residual = !form.factor && form.slope.is_some();
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
            variables,
            blocks: blocks.collect(),
            relative: form.slope.is_none().then_some(form.relative),
            residual,
            unit,
        })
    }

    /// Products of variances that [`Horner::batch`] hands out.
    pub(super) fn products(&self) -> usize {
        if self.unit {
            0
        } else {
            self.blocks.len() * (BLOCK / GROUP)
        }
    }

    /// r' V^-1 r, w' V^-1 w and w' V^-1 r at points of scaled variables `z`.
    #[inline(always)]
    pub(super) fn batch<S: Simd>(
        &self,
        simd: S,
        z: &[Lanes],
        [factor, variance]: [&Lanes; 2],
        products: &mut [Lanes],
    ) -> [Lanes; 3] {
        let mut sums = [[0.0; WIDTH]; 3];
        let of = (factor, variance);
        match self.variables {
            1 => self.vectors::<S, 1, 4, 3>(simd, z, of, products, &mut sums),
            2 => self.vectors::<S, 2, 10, 6>(simd, z, of, products, &mut sums),
            3 => self.vectors::<S, 3, 20, 10>(simd, z, of, products, &mut sums),
            4 => self.vectors::<S, 4, 35, 15>(simd, z, of, products, &mut sums),
            _ => self.vectors::<S, 5, 56, 21>(simd, z, of, products, &mut sums),
        }
        sums
    }

    #[inline(always)]
    fn vectors<S: Simd, const V: usize, const N: usize, const M: usize>(
        &self,
        simd: S,
        z: &[Lanes],
        (factor, variance): (&Lanes, &Lanes),
        products: &mut [Lanes],
        out: &mut [Lanes; 3],
    ) {
        let Some(z) = z.first_chunk::<V>() else {
            return;
        };
        for v in 0..WIDTH / S::F64_LANES {
            let mut variables = [simd.splat_f64s(0.0); V];
            for k in 0..V {
                variables[k] = S::as_simd_f64s(&z[k]).0[v];
            }
            let factor = S::as_simd_f64s(factor).0[v];
            let variance = S::as_simd_f64s(variance).0[v];
            let mut vector = Vector {
                simd,
                z: variables,
                factor,
                variance,
                sum: [simd.splat_f64s(0.0); 3],
            };
            for (b, block) in self.blocks.iter().enumerate() {
                let mut product = [simd.splat_f64s(1.0); BLOCK / GROUP];
                // As many polynomials at a time as the registers hold with what they are made of.
                if S::REGISTER_COUNT >= 32 {
                    vector.add::<N, M, BLOCK>(self, block, 0, &mut product);
                } else {
                    vector.add::<N, M, GROUP>(self, block, 0, &mut product);
                    vector.add::<N, M, GROUP>(self, block, GROUP, &mut product);
                }
                for (g, product) in product.iter().enumerate().filter(|_| !self.unit) {
                    S::as_mut_simd_f64s(&mut products[b * (BLOCK / GROUP) + g]).0[v] = *product;
                }
            }
            for (out, sum) in out.iter_mut().zip(vector.sum) {
                S::as_mut_simd_f64s(out).0[v] = sum;
            }
        }
    }

    /// The same as [`Horner::batch`] at one point, and the logarithm of the variances' product.
    #[inline(always)]
    pub(super) fn single<S: Simd>(&self, simd: S, z: &[f64], of: (f64, f64)) -> ([f64; 3], f64) {
        match self.variables {
            1 => self.point::<S, 1, 4, 3>(simd, z, of),
            2 => self.point::<S, 2, 10, 6>(simd, z, of),
            3 => self.point::<S, 3, 20, 10>(simd, z, of),
            4 => self.point::<S, 4, 35, 15>(simd, z, of),
            _ => self.point::<S, 5, 56, 21>(simd, z, of),
        }
    }

    #[inline(always)]
    fn point<S: Simd, const V: usize, const N: usize, const M: usize>(
        &self,
        simd: S,
        z: &[f64],
        (factor, variance): (f64, f64),
    ) -> ([f64; 3], f64) {
        let mut variables = [simd.splat_f64s(0.0); V];
        for (variable, z) in variables.iter_mut().zip(z) {
            *variable = simd.splat_f64s(*z);
        }
        let a = Point(simd);
        let used = BLOCK / S::F64_LANES;
        let mut sum = [simd.splat_f64s(0.0); 3];
        let mut log_det = 0.0;
        for block in &self.blocks {
            let (mut mean, mut slope) = ([0.0; BLOCK], [0.0; BLOCK]);
            if let Some(c) = block.mean.first_chunk::<N>() {
                let value = cubic::<_, V, N>(&a, &variables, c, 0);
                S::as_mut_simd_f64s(&mut mean)
                    .0
                    .copy_from_slice(&value[..used]);
            }
            if let Some(c) = block.slope.first_chunk::<M>() {
                let place = &mut Place { at: 0, zeros: 0 };
                let value = quadratic::<_, 0, V, M>(&a, &variables, c, place);
                S::as_mut_simd_f64s(&mut slope)
                    .0
                    .copy_from_slice(&value[..used]);
            }
            let mut product = [1.0; BLOCK / GROUP];
            for k in 0..BLOCK {
                let (mut r, mut w) = (mean[k], slope[k]);
                if !self.residual {
                    let mean = factor * mean[k];
                    r = block.measured[k] - mean;
                    w = self.relative.map_or(w, |relative| relative * mean);
                }
                let (mut rv, mut wv) = (r, w);
                if !self.unit {
                    let v = 1.0 + variance * block.spread[k];
                    product[k / GROUP] *= v;
                    let inverse = 1.0 / v;
                    (rv, wv) = (r * inverse, w * inverse);
                }
                for (sum, (a, b)) in sum.iter_mut().zip([(r, rv), (w, wv), (w, rv)]) {
                    // Fused where vectors are.
                    *sum = simd.mul_add_e_f64s(simd.splat_f64s(a), simd.splat_f64s(b), *sum);
                }
            }
            for product in product.iter().filter(|_| !self.unit) {
                log_det += ln(*product);
            }
        }
        let mut out = [0.0; 3];
        for (out, sum) in out.iter_mut().zip(&sum) {
            let mut lanes = [0.0; WIDTH];
            S::as_mut_simd_f64s(&mut lanes).0[0] = *sum;
            *out = lanes[0];
        }
        (out, log_det)
    }
}

/// One vector of points, and their sums r' V^-1 r, w' V^-1 w and w' V^-1 r so far.
struct Vector<S: Simd, const V: usize> {
    simd: S,
    z: [S::f64s; V],
    factor: S::f64s,
    variance: S::f64s,
    sum: [S::f64s; 3],
}

impl<S: Simd, const V: usize> Vector<S, V> {
    /// Adds `G` coordinates of a block from `first` on. Operations are those of [`Horner::point`].
    #[inline(always)]
    fn add<const N: usize, const M: usize, const G: usize>(
        &mut self,
        horner: &Horner,
        block: &Block,
        first: usize,
        product: &mut [S::f64s; BLOCK / GROUP],
    ) {
        let simd = self.simd;
        let a = Points::<S, G> { simd, first };
        let (mut mean, mut slope) = ([simd.splat_f64s(0.0); G], [simd.splat_f64s(0.0); G]);
        if let Some(c) = block.mean.first_chunk::<N>() {
            mean = if horner.unit {
                cubic::<_, V, N>(&a, &self.z, c, BLOCK - 1)
            } else {
                cubic::<_, V, N>(&a, &self.z, c, 0)
            };
        }
        if let Some(c) = block.slope.first_chunk::<M>() {
            slope = quadratic::<_, 0, V, M>(&a, &self.z, c, &mut Place { at: 0, zeros: 0 });
        }
        if !horner.residual {
            for k in 0..G {
                let value = simd.mul_f64s(self.factor, mean[k]);
                mean[k] = simd.sub_f64s(simd.splat_f64s(block.measured[first + k]), value);
                if let Some(relative) = horner.relative {
                    slope[k] = simd.mul_f64s(simd.splat_f64s(relative), value);
                }
            }
        }
        let one = simd.splat_f64s(1.0);
        for k in 0..G {
            let (r, w) = (mean[k], slope[k]);
            let (mut rv, mut wv) = (r, w);
            if !horner.unit {
                let mu = simd.splat_f64s(block.spread[first + k]);
                let v = simd.add_f64s(one, simd.mul_f64s(self.variance, mu));
                let product = &mut product[(first + k) / GROUP];
                *product = simd.mul_f64s(*product, v);
                let inverse = simd.div_f64s(one, v);
                (rv, wv) = (simd.mul_f64s(r, inverse), simd.mul_f64s(w, inverse));
            }
            self.sum[0] = simd.mul_add_e_f64s(r, rv, self.sum[0]);
            self.sum[1] = simd.mul_add_e_f64s(w, wv, self.sum[1]);
            self.sum[2] = simd.mul_add_e_f64s(w, rv, self.sum[2]);
        }
    }
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
