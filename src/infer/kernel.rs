//! The likelihood compiled for speed: the quadratic form of a residual of polynomials with a diagonal plus rank-one
//! covariance.
//!
//! Polynomials are collapsed at the mean thickness, monomials are products of lower ones, and nothing is allocated in the
//! loop. A vector holds one number for each of several points; a point alone stands in every lane. One and the same code
//! evaluates both, so the result does not depend on how points are grouped.

use std::cell::RefCell;

use nalgebra::DMatrix;
use pulp::Simd;

use super::monomials::{ScaledVariable, closure, position, variables, without};
use crate::lanes::{Lanes, Parameters, ln_vector};
use crate::reduce::{Choice, Surface};

/// Coordinates that share a division: the inverse of the product of their variances gives each inverse.
const GROUP: usize = 4;

/// Groups that share a logarithm. More could overflow: a variance may be 1e16, or, at a noise scale of [`LARGEST_SCALE`],
/// 1e36.
const SHARED: usize = 2;

/// Noise scale (1: as estimated) from which on the density is taken as zero.
pub(super) const LARGEST_SCALE: f64 = 1e10;

/// What the kernel needs to know, in coordinates whose covariance is diagonal.
pub(super) struct Parts<'a> {
    /// The response surface, for its variables and exponents.
    pub surface: &'a Surface,
    /// Coefficient of each monomial of the surface in each coordinate.
    pub polynomial: &'a DMatrix<f64>,
    /// The same of the derivative by the thickness (mm), or none where a factor 1/h carries it.
    pub slope: Option<&'a DMatrix<f64>>,
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
    variables: Vec<ScaledVariable>,
    /// Each monomial after the constant as (lower monomial, variable).
    products: Vec<(usize, usize)>,
    /// Coefficients of the mean: [`GROUP`] by group of coordinates, in each monomial by monomial.
    mean: Vec<f64>,
    /// The same of the thickness response times the thickness' sd, unless that is proportional to the mean.
    response: Option<Vec<f64>>,
    /// Thickness response over the mean where they are proportional, else 1.
    relative: f64,
    /// Padded with zeros to whole groups, like all coordinates.
    measured: Vec<f64>,
    /// Empty if the noise scale is fixed: the coordinates are then scaled to unit variance.
    spread: Vec<f64>,
    /// What stands before the polynomials is this over the first parameter.
    factor: Option<f64>,
    constant: f64,
}

/// Room for intermediate values, one a thread, so that an evaluation allocates nothing.
#[derive(Default)]
pub(super) struct Room {
    /// Parameters of points that do not fill their vectors.
    pub points: Vec<f64>,
    /// Monomials and scaled variables.
    pub lanes: Vec<Lanes>,
}

thread_local! {
    static ROOM: RefCell<Room> = RefCell::default();
}

/// Lends this thread's room. It has to be borrowed outside the dispatch: a closure that runs inside another
/// function's body would not be compiled for the dispatched processor.
pub(super) fn with_room<R>(f: impl FnOnce(&mut Room) -> R) -> R {
    ROOM.with_borrow_mut(f)
}

/// r' V^-1 r, w' V^-1 w, w' V^-1 r and det V of the diagonal V, for a vector of points.
#[derive(Clone, Copy)]
struct Forms<T> {
    quad: T,
    ww: T,
    wr: T,
    /// log det V but for `determinant`, the last factors of det V.
    log_det: T,
    determinant: T,
}

impl Kernel {
    pub(super) fn new(parts: &Parts<'_>) -> Self {
        let surface = parts.surface;
        let p = parts.measured.len();
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
        let collapse = |matrix: &DMatrix<f64>, by: f64| {
            let mut columns = vec![vec![0.0; p]; exponents.len()];
            for (m, e) in surface.exponents.iter().enumerate() {
                let power = at.map_or(1.0, |(k, z)| z.powi(i32::from(e[k])));
                let place = position(&exponents, &without(e, at.map(|(k, _)| k)));
                for (k, value) in columns[place].iter_mut().enumerate() {
                    *value += by * power * matrix[(k, m)] * weights[k];
                }
            }
            grouped(&columns, p)
        };
        let pad = |values: &mut dyn Iterator<Item = f64>| {
            let mut values: Vec<f64> = values.collect();
            values.resize(values.len().next_multiple_of(GROUP), 0.0);
            values
        };
        let spread = match parts.scale {
            Some(_) => Vec::new(),
            None => pad(&mut parts.spread.iter().copied()),
        };
        Self {
            variables: variables(surface, at.map(|(k, _)| k)),
            products,
            mean: collapse(parts.polynomial, 1.0),
            response: parts.slope.map(|s| collapse(s, parts.thickness.1)),
            relative: match parts.slope {
                Some(_) => 1.0,
                None => -parts.thickness.1 / parts.thickness.0,
            },
            measured: pad(&mut parts.measured.iter().zip(&weights).map(|(m, w)| m * w)),
            spread,
            factor: surface.variables.factor_numerator(parts.thickness.0),
            constant: -0.5 * variance.iter().map(|v| v.ln()).sum::<f64>(),
        }
    }

    /// The log likelihood of `N` vectors of points (parameters without the thickness) at their noise scales, by
    /// Sherman-Morrison and the determinant lemma.
    #[inline(always)]
    pub(super) fn log_likelihood<S: Simd, const N: usize>(
        &self,
        simd: S,
        points: &[impl Parameters<S>; N],
        scale: &[S::f64s; N],
        lanes: &mut Vec<Lanes>,
    ) -> [S::f64s; N] {
        let count = 1 + self.products.len();
        let needed = count + self.variables.len();
        if lanes.len() < needed {
            lanes.resize(needed, Lanes::splat(0.0));
        }
        let (monomials, z) = lanes.split_at_mut(count);
        self.monomials(simd, points, monomials, z);
        let forms = self.forms(simd, monomials, scale);
        let mut out = [simd.splat_f64s(0.0); N];
        for (out, forms) in out.iter_mut().zip(&forms) {
            let one = simd.add_f64s(simd.splat_f64s(1.0), forms.ww);
            let explained = simd.div_f64s(simd.mul_f64s(forms.wr, forms.wr), one);
            let misfit = simd.sub_f64s(forms.quad, explained);
            let log = ln_vector(simd, simd.mul_f64s(forms.determinant, one));
            let sum = simd.add_f64s(misfit, simd.add_f64s(forms.log_det, log));
            let constant = simd.splat_f64s(self.constant);
            *out = simd.mul_add_e_f64s(simd.splat_f64s(-0.5), sum, constant);
        }
        out
    }

    /// Fills the monomials, with the factor that stands before the polynomials in all of them.
    #[inline(always)]
    fn monomials<S: Simd, const N: usize>(
        &self,
        simd: S,
        points: &[impl Parameters<S>; N],
        monomials: &mut [Lanes],
        z: &mut [Lanes],
    ) {
        let one = simd.splat_f64s(1.0);
        let (mut inverse, mut before) = ([one; N], [one; N]);
        if let Some(factor) = self.factor {
            for v in 0..N {
                inverse[v] = simd.div_f64s(one, points[v].get(simd, 0));
                before[v] = simd.mul_f64s(simd.splat_f64s(factor), inverse[v]);
            }
        }
        for (z, variable) in z.iter_mut().zip(&self.variables) {
            let z = S::as_mut_simd_f64s(z).0;
            let scale = simd.splat_f64s(variable.per_half);
            let offset = simd.splat_f64s(variable.offset);
            for v in 0..N {
                let mut x = points[v].get(simd, variable.numerator);
                if variable.ratio {
                    x = simd.mul_f64s(x, inverse[v]);
                }
                z[v] = simd.mul_add_e_f64s(x, scale, offset);
            }
        }
        S::as_mut_simd_f64s(&mut monomials[0]).0[..N].copy_from_slice(&before);
        for (m, &(lower, variable)) in self.products.iter().enumerate() {
            let (known, next) = monomials.split_at_mut(m + 1);
            let next = S::as_mut_simd_f64s(&mut next[0]).0;
            let (a, b) = (
                S::as_simd_f64s(&known[lower]).0,
                S::as_simd_f64s(&z[variable]).0,
            );
            for v in 0..N {
                next[v] = simd.mul_f64s(a[v], b[v]);
            }
        }
    }

    /// The quadratic forms of all coordinates.
    #[inline(always)]
    fn forms<S: Simd, const N: usize>(
        &self,
        simd: S,
        monomials: &[Lanes],
        scale: &[S::f64s; N],
    ) -> [Forms<S::f64s>; N] {
        let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
        let start = Forms {
            quad: zero,
            ww: zero,
            wr: zero,
            log_det: zero,
            determinant: one,
        };
        let mut forms = [start; N];
        let length = GROUP * monomials.len();
        for (group, mean) in self.mean.chunks_exact(length).enumerate() {
            let at = group * GROUP;
            let mean = accumulate::<S, N>(simd, mean, monomials);
            let response = match &self.response {
                Some(all) => accumulate::<S, N>(simd, &all[at * monomials.len()..], monomials),
                None => mean,
            };
            let spread = self.spread.get(at..at + GROUP);
            for (v, forms) in forms.iter_mut().enumerate() {
                let mut inverse = [one; GROUP];
                if let Some(spread) = spread {
                    if group > 0 && group % SHARED == 0 {
                        let log = ln_vector(simd, forms.determinant);
                        forms.log_det = simd.add_f64s(forms.log_det, log);
                        forms.determinant = one;
                    }
                    let product;
                    (inverse, product) = inverses(simd, spread, scale[v]);
                    forms.determinant = simd.mul_f64s(forms.determinant, product);
                }
                for k in 0..GROUP {
                    let r = simd.sub_f64s(simd.splat_f64s(self.measured[at + k]), mean[k][v]);
                    let w = response[k][v];
                    let (rv, wv) = (simd.mul_f64s(r, inverse[k]), simd.mul_f64s(w, inverse[k]));
                    forms.quad = simd.mul_add_e_f64s(r, rv, forms.quad);
                    forms.ww = simd.mul_add_e_f64s(w, wv, forms.ww);
                    forms.wr = simd.mul_add_e_f64s(w, rv, forms.wr);
                }
            }
        }
        let relative = simd.splat_f64s(self.relative);
        for forms in &mut forms {
            forms.wr = simd.mul_f64s(relative, forms.wr);
            forms.ww = simd.mul_f64s(simd.mul_f64s(relative, relative), forms.ww);
        }
        forms
    }
}

/// The coefficients of `p` coordinates, given monomial by monomial, as [`Kernel::mean`] has them.
fn grouped(columns: &[Vec<f64>], p: usize) -> Vec<f64> {
    let mut all = Vec::with_capacity(columns.len() * p.next_multiple_of(GROUP));
    for first in (0..p).step_by(GROUP) {
        for column in columns {
            all.extend((first..first + GROUP).map(|k| column.get(k).copied().unwrap_or(0.0)));
        }
    }
    all
}

/// Sum over m of coefficients[m][k] monomials[m] for a group of coordinates k and `N` vectors of points.
#[inline(always)]
fn accumulate<S: Simd, const N: usize>(
    simd: S,
    coefficients: &[f64],
    monomials: &[Lanes],
) -> [[S::f64s; N]; GROUP] {
    let mut sum = [[simd.splat_f64s(0.0); N]; GROUP];
    for (c, monomial) in coefficients.chunks_exact(GROUP).zip(monomials) {
        let (m, _) = S::as_simd_f64s(monomial);
        for k in 0..GROUP {
            let c = simd.splat_f64s(c[k]);
            for v in 0..N {
                sum[k][v] = simd.mul_add_e_f64s(c, m[v], sum[k][v]);
            }
        }
    }
    sum
}

/// Inverses of a group's variances 1 + scale^2 spread, and the product of the variances.
#[inline(always)]
fn inverses<S: Simd>(simd: S, spread: &[f64], scale: S::f64s) -> ([S::f64s; GROUP], S::f64s) {
    let one = simd.splat_f64s(1.0);
    let square = simd.mul_f64s(scale, scale);
    let mut v = [one; GROUP];
    for (v, mu) in v.iter_mut().zip(spread) {
        *v = simd.mul_add_e_f64s(square, simd.splat_f64s(*mu), one);
    }
    let (a, b) = (simd.mul_f64s(v[0], v[1]), simd.mul_f64s(v[2], v[3]));
    let product = simd.mul_f64s(a, b);
    let inverse = simd.div_f64s(one, product);
    let (per_a, per_b) = (simd.mul_f64s(inverse, b), simd.mul_f64s(inverse, a));
    let inverses = [
        simd.mul_f64s(per_a, v[1]),
        simd.mul_f64s(per_a, v[0]),
        simd.mul_f64s(per_b, v[3]),
        simd.mul_f64s(per_b, v[2]),
    ];
    (inverses, product)
}
