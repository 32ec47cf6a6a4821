//! The likelihood compiled for speed: quadratic form of the residual of polynomials with a diagonal plus rank-one
//! covariance, for [`WIDTH`] points at once or for one.
//!
//! Polynomials are collapsed at the mean thickness, nothing is allocated in the loop. Plain cubics in few variables go
//! through [`Horner`]; in all others monomials are products of lower ones. Every point undergoes the same operations in
//! the same order whether it comes alone or in company (fused multiply-adds where the processor has them), so the result
//! does not depend on how points are grouped.

use std::cell::RefCell;

use pulp::Simd;

use super::forms::{Finish, Forms, GROUP, Of};
use super::horner::{Form, Horner};
use super::lanes::{Columns, Lanes, WIDTH, each, ln, ln_vector};
use super::monomials::{Variable, closure, position, variables, without};
use super::nested::BLOCK;
use super::sums::{Polynomials, accumulate, accumulate_single, add_group, add_logarithm};
use crate::reduce::{Choice, Surface};

/// What the kernel needs to know, in coordinates whose covariance is diagonal.
pub(super) struct Parts<'a> {
    /// The response surface, for its variables and exponents.
    pub surface: &'a Surface,
    /// Coefficient of each monomial of the surface in each coordinate.
    pub polynomial: &'a nalgebra::DMatrix<f64>,
    /// The same of the derivative by the thickness (mm), or none where a factor 1/h carries it.
    pub slope: Option<&'a nalgebra::DMatrix<f64>>,
    /// Measured coordinates.
    pub measured: &'a [f64],
    /// Variance of each coordinate is 1 + (noise scale)^2 times this.
    pub spread: &'a [f64],
    /// Noise scale, if it is fixed.
    pub scale: Option<f64>,
    /// Mean and sd of the thickness, mm.
    pub thickness: (f64, f64),
}

/// The compiled likelihood.
#[derive(Debug, Clone, Default)]
pub(super) struct Kernel {
    variables: Vec<Variable>,
    /// Each monomial after the constant as (lower monomial, variable).
    products: Vec<(usize, usize)>,
    padded: usize,
    mean: Polynomials,
    /// Thickness response times the thickness' sd; over the first monomials only.
    slope: Option<Polynomials>,
    /// Without slope: response relative to the mean.
    relative: f64,
    measured: Vec<f64>,
    /// Empty if the noise scale is fixed: the coordinates are then scaled to unit variance.
    spread: Vec<f64>,
    /// The factor of the polynomials is this over the first parameter.
    factor: Option<f64>,
    constant: f64,
    /// The whole quadratic form, if it is of plain cubics in few variables.
    horner: Option<Horner>,
}

/// Room for intermediate values, one a thread, so that an evaluation allocates nothing.
#[derive(Default)]
pub(super) struct Scratch {
    /// Parameters of points that do not fill their sets.
    pub points: Vec<f64>,
    /// Monomials and scaled variables of [`WIDTH`] points.
    pub lanes: Vec<Lanes>,
    single: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Lends this thread's scratch. It has to be borrowed outside the dispatch: a closure that runs inside another
/// function's body would not be compiled for the dispatched processor.
pub(super) fn with_scratch<R>(f: impl FnOnce(&mut Scratch) -> R) -> R {
    SCRATCH.with_borrow_mut(f)
}

impl Kernel {
    pub(super) fn new(parts: &Parts<'_>) -> Self {
        let surface = parts.surface;
        let p = parts.measured.len();
        let padded = p.next_multiple_of(BLOCK);
        let variance: Vec<f64> = parts
            .spread
            .iter()
            .map(|mu| parts.scale.map_or(1.0, |s| 1.0 + s * s * mu))
            .collect();
        let weights: Vec<f64> = variance.iter().map(|v| 1.0 / v.sqrt()).collect();
        let t = surface.variables.thickness();
        let plain = surface.variables.choice == Choice::Plain;
        let at = t.filter(|_| plain).map(|k| {
            let [middle, half] = surface.variables.scaling(k);
            (k, (parts.thickness.0 - middle) / half)
        });
        let (exponents, products) = closure(&surface.exponents, at.map(|(k, _)| k));
        let collapse = |matrix: &nalgebra::DMatrix<f64>, by: f64| {
            let mut columns = vec![vec![0.0; p]; exponents.len()];
            for (m, e) in surface.exponents.iter().enumerate() {
                let power = at.map_or(1.0, |(k, z)| z.powi(i32::from(e[k])));
                let place = position(&exponents, &without(e, at.map(|(k, _)| k)));
                for (k, value) in columns[place].iter_mut().enumerate() {
                    *value += by * power * matrix[(k, m)] * weights[k];
                }
            }
            columns
        };
        let mean = collapse(parts.polynomial, 1.0);
        let slope = parts.slope.map(|s| {
            let mut columns = collapse(s, parts.thickness.1);
            while columns.len() > 1 && columns.last().is_some_and(|c| c.iter().all(|v| *v == 0.0)) {
                columns.pop();
            }
            columns
        });
        let pad = |mut values: Vec<f64>| {
            values.resize(values.len().next_multiple_of(BLOCK), 0.0);
            values
        };
        let measured: Vec<f64> = parts
            .measured
            .iter()
            .zip(&weights)
            .map(|(m, w)| m * w)
            .collect();
        let spread = if parts.scale.is_some() {
            &[]
        } else {
            parts.spread
        };
        let factor = surface.variables.factor_numerator(parts.thickness.0);
        let relative = -parts.thickness.1 / parts.thickness.0;
        let variables = variables(surface, at.map(|(k, _)| k));
        // The polynomials are those of the residual where no factor stands before them and no variance changes.
        let plain = slope
            .as_ref()
            .filter(|_| factor.is_none() && spread.is_empty());
        let horner = plain.and_then(|slope| {
            Horner::new(&Form {
                exponents: &exponents,
                mean: &mean,
                slope,
                measured: &measured,
                variables: &variables,
            })
        });
        Self {
            variables,
            products,
            padded,
            mean: Polynomials::new(&mean, padded),
            slope: slope.map(|s| Polynomials::new(&s, padded)),
            relative,
            measured: pad(measured),
            spread: pad(spread.to_vec()),
            factor,
            constant: -0.5 * variance.iter().map(|v| v.ln()).sum::<f64>(),
            horner,
        }
    }

    /// The quadratic forms at one point, in every lane, by the operations of [`Kernel::batch`].
    #[inline(always)]
    pub(super) fn single<S: Simd>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        x: &[f64],
        scale: f64,
    ) -> Forms<S::f64s> {
        match &self.horner {
            Some(horner) => horner.single(simd, x),
            None => self.sums_single(simd, scratch, x, scale).splat(simd),
        }
    }

    /// What `finish` makes of the quadratic forms at the points (parameters without the thickness), for as many as `out`
    /// has, a multiple of [`WIDTH`].
    #[inline(always)]
    pub(super) fn batch<S: Simd>(
        &self,
        simd: S,
        points: Columns<'_>,
        finish: &impl Finish,
        lanes: &mut Vec<Lanes>,
        out: &mut [f64],
    ) {
        if let Some(horner) = &self.horner {
            return horner.batch(simd, points, finish, out);
        }
        let room = 1 + self.products.len() + self.variables.len();
        if lanes.len() < room {
            lanes.resize(room, Lanes::splat(0.0));
        }
        for (set, out) in out.chunks_exact_mut(WIDTH).enumerate() {
            let points = points.from(set * WIDTH);
            let mut scale = Lanes::splat(1.0);
            for (v, scale) in S::as_mut_simd_f64s(&mut scale).0.iter_mut().enumerate() {
                *scale = finish.scales(simd, &Of(points, v));
            }
            let forms = self.sums(simd, points, &scale, lanes);
            for (v, out) in S::as_mut_simd_f64s(out).0.iter_mut().enumerate() {
                *out = finish.finish(simd, &Of(points, v), &forms.vector(simd, v));
            }
        }
    }

    /// The sums of monomials at the first [`WIDTH`] points.
    #[inline(always)]
    fn sums<S: Simd>(
        &self,
        simd: S,
        points: Columns<'_>,
        scale: &Lanes,
        lanes: &mut [Lanes],
    ) -> Forms<Lanes> {
        let (monomials, z) = lanes.split_at_mut(1 + self.products.len());
        self.scaled(points, z);
        monomials[0] = Lanes::splat(1.0);
        for (m, &(lower, variable)) in self.products.iter().enumerate() {
            let (before, after) = monomials.split_at_mut(m + 1);
            let (a, b) = (&before[lower], &z[variable]);
            after[0] = each(|l| a[l] * b[l]);
        }
        self.forms(simd, monomials, points, scale)
    }

    /// What stands before the polynomials.
    #[inline(always)]
    fn factors(&self, x: Columns<'_>) -> Lanes {
        match self.factor {
            Some(f) => {
                let first = x.lanes(0);
                each(|l| f / first[l])
            }
            None => Lanes::splat(1.0),
        }
    }

    #[inline(always)]
    fn scaled(&self, x: Columns<'_>, z: &mut [Lanes]) {
        let first = x.lanes(0);
        for (z, v) in z.iter_mut().zip(&self.variables) {
            let x = x.lanes(v.numerator);
            *z = if v.ratio {
                each(|l| (x[l] / first[l] - v.middle) * v.per_half)
            } else {
                each(|l| (x[l] - v.middle) * v.per_half)
            };
        }
    }

    /// The quadratic forms of all coordinates.
    #[inline(always)]
    fn forms<S: Simd>(
        &self,
        simd: S,
        monomials: &[Lanes],
        x: Columns<'_>,
        scale: &Lanes,
    ) -> Forms<Lanes> {
        let mut sums = Forms::default();
        let factor = self.factors(x);
        let variance = each(|l| scale[l] * scale[l]);
        let zero = simd.splat_f64s(0.0);
        for pair in (0..WIDTH / S::F64_LANES).step_by(2) {
            let two = |lanes: &Lanes| {
                let (v, _) = S::as_simd_f64s(lanes);
                [v[pair], v[pair + 1]]
            };
            let (factor, variance) = (two(&factor), two(&variance));
            let mut sum = [[zero; 2]; 3];
            for group in 0..self.padded / GROUP {
                let mean = self.mean.group(group, self.padded);
                let mut mean = accumulate(simd, mean, monomials, pair);
                for mean in &mut mean {
                    *mean = [0, 1].map(|h| simd.mul_f64s(factor[h], mean[h]));
                }
                let response = match &self.slope {
                    Some(slope) => {
                        accumulate(simd, slope.group(group, self.padded), monomials, pair)
                    }
                    None => {
                        let relative = simd.splat_f64s(self.relative);
                        mean.map(|m| [0, 1].map(|h| simd.mul_f64s(relative, m[h])))
                    }
                };
                let at = group * GROUP..(group + 1) * GROUP;
                let spread = self.spread.get(at.clone());
                let product = add_group(
                    simd,
                    &self.measured[at],
                    [&mean, &response],
                    spread.map(|mu| (mu, variance)),
                    &mut sum,
                );
                if spread.is_some() {
                    add_logarithm(simd, product, pair, &mut sums.log_det);
                }
            }
            for (sums, sum) in [&mut sums.quad, &mut sums.ww, &mut sums.wr]
                .into_iter()
                .zip(sum)
            {
                let (sums, _) = S::as_mut_simd_f64s(sums);
                (sums[pair], sums[pair + 1]) = (sum[0], sum[1]);
            }
        }
        sums
    }

    /// The log likelihood by Sherman-Morrison and the determinant lemma, plus `constant`, minus half of `square` (of a
    /// prior, where one comes along).
    #[inline(always)]
    pub(super) fn log_likelihood<S: Simd>(
        &self,
        simd: S,
        forms: &Forms<S::f64s>,
        square: S::f64s,
        constant: S::f64s,
    ) -> S::f64s {
        let one = simd.add_f64s(simd.splat_f64s(1.0), forms.ww);
        let explained = simd.div_f64s(simd.mul_f64s(forms.wr, forms.wr), one);
        let misfit = simd.sub_f64s(simd.add_f64s(forms.quad, square), explained);
        let log_det = simd.add_f64s(forms.log_det, ln_vector(simd, one));
        let sum = simd.add_f64s(misfit, log_det);
        let constant = simd.add_f64s(constant, simd.splat_f64s(self.constant));
        simd.mul_add_e_f64s(simd.splat_f64s(-0.5), sum, constant)
    }

    /// The sums of monomials at one point, by the operations of [`Kernel::batch`].
    #[inline(always)]
    fn sums_single<S: Simd>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        x: &[f64],
        scale: f64,
    ) -> Forms<f64> {
        let (count, padded) = (1 + self.products.len(), self.padded);
        let length = count + self.variables.len() + 2 * padded;
        let room = &mut scratch.single;
        if room.len() < length {
            room.resize(length, 0.0);
        }
        let (monomials, rest) = room[..length].split_at_mut(count);
        let (z, rest) = rest.split_at_mut(self.variables.len());
        let (mean, response) = rest.split_at_mut(padded);
        for (z, v) in z.iter_mut().zip(&self.variables) {
            let raw = x[v.numerator];
            let raw = if v.ratio { raw / x[0] } else { raw };
            *z = (raw - v.middle) * v.per_half;
        }
        let factor = self.factor.map_or(1.0, |f| f / x[0]);
        monomials[0] = 1.0;
        for (m, &(lower, variable)) in self.products.iter().enumerate() {
            monomials[m + 1] = monomials[lower] * z[variable];
        }
        accumulate_single(simd, &self.mean.rows, monomials, mean);
        if let Some(slope) = &self.slope {
            accumulate_single(simd, &slope.rows, monomials, response);
        }
        self.forms_single(mean, response, factor, scale * scale)
    }

    #[inline(always)]
    fn forms_single(
        &self,
        mean: &[f64],
        response: &[f64],
        factor: f64,
        variance: f64,
    ) -> Forms<f64> {
        let (mut quad, mut ww, mut wr, mut log_det) = (0.0, 0.0, 0.0, 0.0);
        let mut product = 1.0;
        for k in 0..self.padded {
            let mean = factor * mean[k];
            let response = match &self.slope {
                Some(_) => response[k],
                None => self.relative * mean,
            };
            let r = self.measured[k] - mean;
            let (rv, wv) = match self.spread.get(k) {
                None => (r, response),
                Some(mu) => {
                    let v = 1.0 + variance * mu;
                    product *= v;
                    let inverse = 1.0 / v;
                    (r * inverse, response * inverse)
                }
            };
            quad += r * rv;
            ww += response * wv;
            wr += response * rv;
            if k % GROUP == GROUP - 1 && !self.spread.is_empty() {
                log_det += ln(product);
                product = 1.0;
            }
        }
        Forms {
            quad,
            ww,
            wr,
            log_det,
        }
    }
}
