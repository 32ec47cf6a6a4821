//! The posterior of elastic constants, mechanical amplitudes and noise.

use super::density::LogDensity;
use super::kernel::{Scratch, with_scratch};
use super::lanes::{Lanes, WIDTH, each, ln};
use super::likelihood::Likelihood;
use super::prior::Marginal;
use crate::laminate::Material;

/// Name of the noise parameter.
pub const NOISE: &str = "noise_nm";

/// Log posterior over (elastic constants, mechanical amplitudes, noise sd of a point in nm unless it is declared).
#[derive(Clone)]
pub struct Posterior {
    names: Vec<String>,
    material: Material,
    marginals: Vec<Marginal>,
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
            names.push(NOISE.into());
        }
        likelihood.compile(declared_nm.map(|noise| noise / reference_nm));
        Self {
            constant: marginals.iter().map(Marginal::log_normalisation).sum(),
            names,
            material,
            marginals,
            likelihood,
            reference_nm,
            declared_nm,
        }
    }

    /// The same density times exp(`constant`).
    #[must_use]
    pub fn shifted(mut self, constant: f64) -> Self {
        self.constant += constant;
        self
    }

    /// The likelihood.
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
        whole
    }

    /// The same density with other priors of the parameters without the noise, in their order.
    #[must_use]
    pub fn with_marginals(&self, marginals: Vec<Marginal>) -> Self {
        let normalisation = |m: &[Marginal]| m.iter().map(Marginal::log_normalisation).sum::<f64>();
        let mut other = self.clone();
        other.constant += normalisation(&marginals) - normalisation(&self.marginals);
        other.marginals = marginals;
        other
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

    /// Log prior of the parameters without the noise, -inf beyond their bounds. In vectors by hand: the compiler makes
    /// branches of the comparisons.
    #[inline(always)]
    fn marginal_lanes<S: pulp::Simd>(&self, simd: S, x: &[Lanes]) -> Lanes {
        let mut out = [0.0; WIDTH];
        let (half, never) = (simd.splat_f64s(0.5), simd.splat_f64s(f64::NEG_INFINITY));
        for (v, out) in S::as_mut_simd_f64s(&mut out).0.iter_mut().enumerate() {
            let mut log = simd.splat_f64s(self.constant);
            for (x, m) in x.iter().zip(&self.marginals) {
                let x = S::as_simd_f64s(x).0[v];
                let [low, high] = m.bounds();
                let inside = simd.and_m64s(
                    simd.less_than_or_equal_f64s(simd.splat_f64s(low), x),
                    simd.less_than_or_equal_f64s(x, simd.splat_f64s(high)),
                );
                let distance = simd.sub_f64s(x, simd.splat_f64s(m.mean));
                let z = simd.mul_f64s(distance, simd.splat_f64s(1.0 / m.sd));
                let less = simd.sub_f64s(log, simd.mul_f64s(simd.mul_f64s(half, z), z));
                log = simd.select_f64s(inside, less, never);
            }
            *out = log;
        }
        out
    }

    /// The same of one point, by the same operations.
    #[inline(always)]
    fn marginal(&self, x: &[f64]) -> f64 {
        let mut log = self.constant;
        for (x, m) in x.iter().zip(&self.marginals) {
            let [low, high] = m.bounds();
            let z = (x - m.mean) * (1.0 / m.sd);
            let inside = (low <= *x) & (*x <= high);
            log = if inside {
                log - 0.5 * z * z
            } else {
                f64::NEG_INFINITY
            };
        }
        log
    }

    /// What points of log prior `log` add to the log likelihood, -inf outside the support.
    #[inline(always)]
    fn prior<const N: usize>(
        &self,
        mut log: [f64; N],
        x: impl Fn(usize, usize) -> f64,
        scale: &[f64; N],
    ) -> [f64; N] {
        if self.declared_nm.is_none() {
            // What contrasts and local differences say, and the prior 1/noise.
            let freedom = self.likelihood.freedom();
            for (log, &s) in log.iter_mut().zip(scale) {
                *log -= freedom * 0.5 / (s * s) + (freedom + 1.0) * ln(s);
            }
        }
        // A loop for each material, and no branch in either, so that they vectorise.
        let kept = |possible: bool, log: f64| if possible { log } else { f64::NEG_INFINITY };
        match self.material {
            Material::Laminate => {
                for (l, log) in log.iter_mut().enumerate() {
                    let ply = Material::Laminate.ply(&[x(0, l), x(1, l), x(2, l), x(3, l)]);
                    *log = kept(ply.is_admissible(), *log);
                }
            }
            Material::Isotropic => {
                for (l, log) in log.iter_mut().enumerate() {
                    let ply = Material::Isotropic.ply(&[x(0, l), x(1, l)]);
                    *log = kept(ply.is_admissible(), *log);
                }
            }
        }
        for (log, &s) in log.iter_mut().zip(scale) {
            // without branches, so that the loop vectorises
            let (above, below) = (s >= f64::MIN_POSITIVE, s < f64::INFINITY);
            *log = kept(above & below, *log);
        }
        log
    }

    /// Log density at the [`WIDTH`] points of `scratch`.
    #[inline(always)]
    fn lanes<S: pulp::Simd>(&self, simd: S, scratch: &mut Scratch) -> Lanes {
        let scale = match self.declared_nm {
            Some(noise) => [noise / self.reference_nm; WIDTH],
            None => each(|l| scratch.points[self.marginals.len()][l] / self.reference_nm),
        };
        let likelihood = self.likelihood.kernel().batch(simd, scratch, &scale);
        let x = &scratch.points;
        let prior = self.prior(self.marginal_lanes(simd, x), |k, l| x[k][l], &scale);
        each(|l| Self::sum(prior[l], likelihood[l]))
    }

    /// Prior and likelihood; what is outside the support stays there, whatever the likelihood there is.
    #[inline(always)]
    fn sum(prior: f64, likelihood: f64) -> f64 {
        if prior == f64::NEG_INFINITY {
            prior
        } else {
            prior + likelihood
        }
    }
}

impl LogDensity for Posterior {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> f64 {
        with_scratch(|scratch| {
            pulp::Arch::new().dispatch(One {
                posterior: self,
                scratch,
                x,
            })
        })
    }

    fn log_density_batch(&self, xs: &[f64], out: &mut [f64]) {
        with_scratch(|scratch| {
            pulp::Arch::new().dispatch(Many {
                posterior: self,
                scratch,
                xs,
                out,
            });
        });
    }
}

struct One<'a> {
    posterior: &'a Posterior,
    scratch: &'a mut Scratch,
    x: &'a [f64],
}

impl pulp::WithSimd for One<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> f64 {
        let Self {
            posterior,
            scratch,
            x,
        } = self;
        let scale = posterior.scale(x);
        let [prior] = posterior.prior([posterior.marginal(x)], |k, _| x[k], &[scale]);
        if prior == f64::NEG_INFINITY {
            return prior;
        }
        let kernel = posterior.likelihood.kernel();
        Posterior::sum(prior, kernel.single(simd, scratch, x, scale))
    }
}

struct Many<'a> {
    posterior: &'a Posterior,
    scratch: &'a mut Scratch,
    xs: &'a [f64],
    out: &'a mut [f64],
}

impl pulp::WithSimd for Many<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self {
            posterior,
            scratch,
            xs,
            out,
        } = self;
        scratch.points.resize(posterior.dim(), [1.0; WIDTH]);
        let count = out.len();
        for first in (0..count).step_by(WIDTH) {
            let some = first..(first + WIDTH).min(count);
            for (k, x) in scratch.points.iter_mut().enumerate() {
                let column = &xs[k * count..(k + 1) * count];
                match column[first..].first_chunk() {
                    Some(whole) => *x = *whole,
                    None => x[..some.len()].copy_from_slice(&column[some.clone()]),
                }
            }
            let values = posterior.lanes(simd, scratch);
            match out[first..].first_chunk_mut() {
                Some(whole) => *whole = values,
                None => out[some.clone()].copy_from_slice(&values[..some.len()]),
            }
        }
    }
}
