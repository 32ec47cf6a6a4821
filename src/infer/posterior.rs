//! The posterior of elastic constants, mechanical amplitudes and noise.

use super::kernel::{LARGEST_SCALE, Room, with_room};
use super::known::Known;
use super::likelihood::Likelihood;
use super::prior::Marginal;
use crate::error::Result;
use crate::laminate::Material;
use crate::lanes::{Lanes, Parameters, Repeated, Together, first, ln_vector};
use crate::parameter;
use crate::sample::{DensityError, LogDensity};

/// Parameters farther from their priors' means, prior sds, are no finding: what the model lacks has driven them there.
pub const REASON_SDS: f64 = 6.0;

/// Log posterior over (elastic constants, mechanical amplitudes, noise sd of a point in nm unless it is declared).
#[derive(Clone)]
pub struct Posterior {
    names: Vec<String>,
    material: Material,
    marginals: Vec<Marginal>,
    normals: Vec<NormalPrior>,
    /// What other experiments say of the constants.
    known: Option<Elsewhere>,
    likelihood: Likelihood,
    /// The noise in nm at scale 1.
    reference_nm: f64,
    declared_nm: Option<f64>,
    /// Logarithm of the priors' normalisation, and of whatever else is constant.
    constant: f64,
}

impl Posterior {
    /// `names` and `marginals` cover the constants and mechanical amplitudes; the noise follows them unless
    /// `declared_nm` fixes it. Its prior is 1/noise.
    pub fn new(
        mut names: Vec<String>,
        material: Material,
        marginals: Vec<Marginal>,
        mut likelihood: Likelihood,
        reference_nm: f64,
        declared_nm: Option<f64>,
    ) -> Self {
        if declared_nm.is_none() {
            names.push(parameter::NOISE.into());
        }
        likelihood.compile(declared_nm.map(|noise| noise / reference_nm));
        Self {
            constant: marginals.iter().map(Marginal::log_normalisation).sum(),
            names,
            material,
            normals: NormalPrior::of(&marginals),
            marginals,
            known: None,
            likelihood,
            reference_nm,
            declared_nm,
        }
    }

    /// The same density times what other experiments say of the constants.
    #[must_use]
    pub fn beside(mut self, known: &Known) -> Self {
        self.known = Some(Elsewhere::new(known));
        self
    }

    pub fn likelihood(&self) -> &Likelihood {
        &self.likelihood
    }

    /// Number of parameters without the noise.
    pub fn structural(&self) -> usize {
        self.marginals.len()
    }

    /// Names of the parameters without the noise.
    pub fn parameter_names(&self) -> &[String] {
        &self.names[..self.marginals.len()]
    }

    /// The same density without the priors' cuts.
    #[must_use]
    pub fn untruncated(&self) -> Self {
        let mut whole = self.clone();
        for marginal in &mut whole.marginals {
            marginal.truncate = None;
        }
        whole.normals = NormalPrior::of(&whole.marginals);
        whole
    }

    /// The same density with other priors of the parameters without the noise, in their order.
    #[must_use]
    pub fn with_marginals(&self, marginals: Vec<Marginal>) -> Self {
        let normalisation = |m: &[Marginal]| m.iter().map(Marginal::log_normalisation).sum::<f64>();
        let mut other = self.clone();
        other.constant += normalisation(&marginals) - normalisation(&self.marginals);
        other.normals = NormalPrior::of(&marginals);
        other.marginals = marginals;
        other
    }

    /// Whether a point's parameters without the noise lie within [`REASON_SDS`] of their priors' means.
    pub fn is_credible(&self, x: &[f64]) -> bool {
        let mut pairs = self.marginals.iter().zip(x);
        pairs.all(|(m, x)| (x - m.mean).abs() <= REASON_SDS * m.sd)
    }

    /// The same density, cut off [`REASON_SDS`] from the priors' means and a tenth of the elastic constants' from zero.
    #[must_use]
    pub fn within_reason(&self) -> Self {
        let constants = self.material.constants().len();
        let cut = |(k, m): (usize, &Marginal)| {
            let [low, high] = m.bounds();
            let floor = if k < constants {
                0.1 * m.mean
            } else {
                f64::NEG_INFINITY
            };
            let reach = REASON_SDS * m.sd;
            Marginal {
                truncate: Some([low.max(m.mean - reach).max(floor), high.min(m.mean + reach)]),
                ..*m
            }
        };
        self.with_marginals(self.marginals.iter().enumerate().map(cut).collect())
    }

    /// Whether a point (its first parameters are the elastic constants) is an admissible ply.
    pub fn is_admissible(&self, theta: &[f64]) -> bool {
        self.material.ply(theta).is_admissible()
    }

    /// Priors of the parameters without the noise.
    pub fn marginals(&self) -> &[Marginal] {
        &self.marginals
    }

    /// Noise scale of a point of the parameter space.
    pub fn scale(&self, x: &[f64]) -> f64 {
        self.declared_nm.unwrap_or_else(|| x[self.marginals.len()]) / self.reference_nm
    }

    /// A point to start from and the sd to start with: prior means, estimated noise. A surface of a narrower design knows
    /// nothing of prior means outside it: the middle of the design takes their place.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let mut centre: Vec<f64> = self.marginals.iter().map(|m| m.mean).collect();
        let mut sd: Vec<f64> = self.marginals.iter().map(|m| m.sd).collect();
        if !self.likelihood.is_in_design(&centre) {
            for (k, [middle, half]) in self.likelihood.design().into_iter().enumerate() {
                centre[k] = middle;
                sd[k] = sd[k].min(half);
            }
        }
        if self.declared_nm.is_none() {
            centre.push(self.reference_nm);
            sd.push(0.05 * self.reference_nm);
        }
        (centre, sd)
    }

    /// [`crate::laminate::Ply::is_admissible`] of a vector of points.
    #[inline(always)]
    fn admissible<S: pulp::Simd>(&self, simd: S, x: &impl Parameters<S>) -> S::m64s {
        let zero = simd.splat_f64s(0.0);
        match self.material {
            Material::Ply => {
                let [e1, e2] = [x.get(simd, 0), x.get(simd, 1)];
                let [nu12, g12] = [x.get(simd, 2), x.get(simd, 3)];
                let young =
                    simd.and_m64s(simd.less_than_f64s(zero, e1), simd.less_than_f64s(zero, e2));
                let moduli = simd.and_m64s(young, simd.less_than_f64s(zero, g12));
                let coupled = simd.mul_f64s(simd.mul_f64s(nu12, nu12), e2);
                simd.and_m64s(moduli, simd.less_than_f64s(coupled, e1))
            }
            Material::Isotropic => {
                let [e, nu] = [x.get(simd, 0), x.get(simd, 1)];
                let coupled = simd.mul_f64s(nu, nu);
                simd.and_m64s(
                    simd.less_than_f64s(zero, e),
                    simd.less_than_f64s(coupled, simd.splat_f64s(1.0)),
                )
            }
        }
    }
}

impl Posterior {
    /// Noise scales of a vector of points.
    #[inline(always)]
    fn scales<S: pulp::Simd>(&self, simd: S, x: &impl Parameters<S>) -> S::f64s {
        let noise = match self.declared_nm {
            Some(noise) => simd.splat_f64s(noise),
            None => x.get(simd, self.marginals.len()),
        };
        simd.mul_f64s(noise, simd.splat_f64s(1.0 / self.reference_nm))
    }

    /// Log densities of `N` vectors of points, -inf outside the support.
    #[inline(always)]
    fn log_densities<S: pulp::Simd, const N: usize>(
        &self,
        simd: S,
        points: &[impl Parameters<S>; N],
        lanes: &mut Vec<Lanes>,
    ) -> [S::f64s; N] {
        let mut scale = [simd.splat_f64s(1.0); N];
        for (scale, x) in scale.iter_mut().zip(points) {
            *scale = self.scales(simd, x);
        }
        let mut out = self
            .likelihood
            .kernel()
            .log_likelihood(simd, points, &scale, lanes);
        for ((out, x), scale) in out.iter_mut().zip(points).zip(scale) {
            *out = self.with_prior(simd, x, scale, *out);
        }
        out
    }

    /// The log density of a vector of points whose log likelihood is known.
    #[inline(always)]
    fn with_prior<S: pulp::Simd>(
        &self,
        simd: S,
        x: &impl Parameters<S>,
        scale: S::f64s,
        log_likelihood: S::f64s,
    ) -> S::f64s {
        let mut inside = self.admissible(simd, x);
        let mut square = simd.splat_f64s(0.0);
        for (k, m) in self.normals.iter().enumerate() {
            let x = x.get(simd, k);
            if m.bounded {
                let (low, high) = (simd.splat_f64s(m.low), simd.splat_f64s(m.high));
                inside = simd.and_m64s(inside, simd.less_than_or_equal_f64s(low, x));
                inside = simd.and_m64s(inside, simd.less_than_or_equal_f64s(x, high));
            }
            let per_sd = simd.splat_f64s(m.per_sd);
            let z = simd.mul_add_e_f64s(x, per_sd, simd.splat_f64s(m.offset));
            square = simd.mul_add_e_f64s(z, z, square);
        }
        let constant = simd.splat_f64s(self.constant);
        let mut density = simd.mul_add_e_f64s(simd.splat_f64s(-0.5), square, constant);
        if let Some(known) = &self.known {
            density = simd.add_f64s(density, known.log_density(simd, x));
        }
        if self.declared_nm.is_none() {
            let (least, largest) = (f64::MIN_POSITIVE, LARGEST_SCALE);
            let positive = simd.less_than_or_equal_f64s(simd.splat_f64s(least), scale);
            let finite = simd.less_than_f64s(scale, simd.splat_f64s(largest));
            inside = simd.and_m64s(inside, simd.and_m64s(positive, finite));
            // What contrasts and local differences say, and the prior 1/noise.
            let freedom = self.likelihood.freedom();
            let squared = simd.mul_f64s(scale, scale);
            let contrasts = simd.div_f64s(simd.splat_f64s(0.5 * freedom), squared);
            let log = simd.mul_f64s(simd.splat_f64s(freedom + 1.0), ln_vector(simd, scale));
            density = simd.sub_f64s(density, simd.add_f64s(contrasts, log));
        }
        let density = simd.add_f64s(density, log_likelihood);
        simd.select_f64s(inside, density, simd.splat_f64s(f64::NEG_INFINITY))
    }
}

/// What other experiments say, ready for evaluation: of distances d from some means, b'd - d'A d / 2.
#[derive(Clone)]
struct Elsewhere {
    means: Vec<f64>,
    /// A, row by row.
    precision: Vec<f64>,
    towards: Vec<f64>,
}

impl Elsewhere {
    fn new(known: &Known) -> Self {
        let (means, precision, towards) = known.in_border_units();
        Self {
            means,
            precision,
            towards,
        }
    }

    #[inline(always)]
    fn log_density<S: pulp::Simd>(&self, simd: S, x: &impl Parameters<S>) -> S::f64s {
        let n = self.means.len();
        let distance = |k: usize| simd.sub_f64s(x.get(simd, k), simd.splat_f64s(self.means[k]));
        let mut sum = simd.splat_f64s(0.0);
        for i in 0..n {
            let mut slope = simd.splat_f64s(self.towards[i]);
            for j in 0..n {
                let a = simd.splat_f64s(-0.5 * self.precision[i * n + j]);
                slope = simd.mul_add_e_f64s(a, distance(j), slope);
            }
            sum = simd.mul_add_e_f64s(slope, distance(i), sum);
        }
        sum
    }
}

/// A marginal ready for evaluation.
#[derive(Clone, Copy)]
struct NormalPrior {
    per_sd: f64,
    /// What is added to x / sd.
    offset: f64,
    bounded: bool,
    low: f64,
    high: f64,
}

impl NormalPrior {
    fn of(marginals: &[Marginal]) -> Vec<Self> {
        let normal = |m: &Marginal| {
            let [low, high] = m.bounds();
            Self {
                per_sd: 1.0 / m.sd,
                offset: -m.mean / m.sd,
                bounded: low > f64::NEG_INFINITY || high < f64::INFINITY,
                low,
                high,
            }
        };
        marginals.iter().map(normal).collect()
    }
}

impl LogDensity for Posterior {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        DensityError::sort(with_room(|room| {
            pulp::Arch::new().dispatch(OnePoint {
                posterior: self,
                room,
                x,
            })
        }))
    }

    fn values(&self, xs: &[f64], out: &mut [f64]) -> Result<()> {
        with_room(|room| {
            pulp::Arch::new().dispatch(Batch {
                posterior: self,
                room,
                xs,
                out,
            });
        });
        Ok(())
    }
}

struct OnePoint<'a> {
    posterior: &'a Posterior,
    room: &'a mut Room,
    x: &'a [f64],
}

impl pulp::WithSimd for OnePoint<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> f64 {
        let lanes = &mut self.room.lanes;
        let [density] = self
            .posterior
            .log_densities(simd, &[Repeated(self.x)], lanes);
        first(simd, density)
    }
}

struct Batch<'a> {
    posterior: &'a Posterior,
    room: &'a mut Room,
    xs: &'a [f64],
    out: &'a mut [f64],
}

/// Vectors of points that are evaluated together: enough sums to keep the processor busy, few enough for its registers.
const PAIR: usize = 2;

impl pulp::WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self {
            posterior,
            room: Room { points, lanes },
            xs,
            out,
        } = self;
        let count = out.len();
        let (whole, rest) = out.split_at_mut(count - count % (PAIR * S::F64_LANES));
        let (whole_out, _) = S::as_mut_simd_f64s(whole);
        for (pair, out) in whole_out.chunks_exact_mut(PAIR).enumerate() {
            let together = |v| Together {
                values: xs,
                stride: count,
                vector: PAIR * pair + v,
            };
            let pair: [_; PAIR] = [together(0), together(1)];
            out.copy_from_slice(&posterior.log_densities(simd, &pair, lanes));
        }
        // What fills the last vector up is not looked at.
        let first = count - rest.len();
        points.resize(posterior.dim() * S::F64_LANES, 1.0);
        for (k, out) in rest.chunks_mut(S::F64_LANES).enumerate() {
            for (to, from) in points
                .chunks_exact_mut(S::F64_LANES)
                .zip(xs.chunks_exact(count))
            {
                let from = &from[first + k * S::F64_LANES..];
                to[..out.len()].copy_from_slice(&from[..out.len()]);
            }
            let vector = [Together {
                values: points,
                stride: S::F64_LANES,
                vector: 0,
            }];
            let [densities] = posterior.log_densities(simd, &vector, lanes);
            let mut values = Lanes::splat(0.0);
            S::as_mut_simd_f64s(&mut values).0[0] = densities;
            out.copy_from_slice(&values[..out.len()]);
        }
    }
}
