//! The posterior of elastic constants, mechanical amplitudes and noise.

use super::density::LogDensity;
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
}

impl Posterior {
    /// `names` and `marginals` cover the constants and mechanical amplitudes; the noise follows them unless
    /// `declared_nm` fixes it. Its prior is 1/noise.
    pub fn new(
        mut names: Vec<String>,
        material: Material,
        marginals: Vec<Marginal>,
        likelihood: Likelihood,
        reference_nm: f64,
        declared_nm: Option<f64>,
    ) -> Self {
        if declared_nm.is_none() {
            names.push(NOISE.into());
        }
        Self {
            names,
            material,
            marginals,
            likelihood,
            reference_nm,
            declared_nm,
        }
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

    /// Priors of the parameters without the noise.
    pub fn marginals(&self) -> &[Marginal] {
        &self.marginals
    }

    /// Noise scale of a point of the parameter space.
    pub fn scale(&self, x: &[f64]) -> f64 {
        self.declared_nm.unwrap_or_else(|| x[self.marginals.len()]) / self.reference_nm
    }

    /// A point to start from and the sd to start with: prior means, estimated noise.
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let mut centre: Vec<f64> = self.marginals.iter().map(|m| m.mean).collect();
        let mut sd: Vec<f64> = self.marginals.iter().map(|m| m.sd).collect();
        if self.declared_nm.is_none() {
            centre.push(self.reference_nm);
            sd.push(0.05 * self.reference_nm);
        }
        (centre, sd)
    }
}

impl LogDensity for Posterior {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> f64 {
        let scale = self.scale(x);
        let possible = scale > 0.0 && scale.is_finite();
        if !possible || !self.material.ply(x).is_admissible() {
            return f64::NEG_INFINITY;
        }
        let theta = &x[..self.marginals.len()];
        let prior: f64 = self
            .marginals
            .iter()
            .zip(theta)
            .map(|(m, &x)| m.log_density(x))
            .sum();
        if prior == f64::NEG_INFINITY {
            return prior;
        }
        let noise = match self.declared_nm {
            Some(_) => 0.0,
            None => self.likelihood.log_noise(scale) - scale.ln(),
        };
        prior + noise + self.likelihood.log_likelihood(theta, scale)
    }
}
