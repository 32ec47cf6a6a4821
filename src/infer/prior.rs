//! Priors of the sampled parameters.

use serde::{Deserialize, Serialize};

/// A prior as the model file gives it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum PriorSpec {
    /// Normal, in the parameter's unit.
    Normal { mean: f64, sd: f64 },
}

/// One parameter's normal prior, cut at bounds if there are any.
#[derive(Debug, Clone, Copy)]
pub struct Marginal {
    pub mean: f64,
    pub sd: f64,
    /// Bounds outside which the density is zero.
    pub truncate: Option<[f64; 2]>,
}

impl Marginal {
    /// Bounds, infinite if there are none.
    #[inline(always)]
    pub fn bounds(&self) -> [f64; 2] {
        self.truncate.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// No prior: density 1 everywhere.
    pub fn flat(mean: f64) -> Self {
        Self {
            mean,
            sd: f64::INFINITY,
            truncate: None,
        }
    }

    /// Logarithm of the normalisation, which ignores the cut: that is the same for every point.
    pub fn log_normalisation(&self) -> f64 {
        if self.sd == f64::INFINITY {
            return 0.0;
        }
        -self.sd.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
    }

    pub fn log_density(&self, x: f64) -> f64 {
        let [low, high] = self.bounds();
        if !(low..=high).contains(&x) {
            return f64::NEG_INFINITY;
        }
        let z = (x - self.mean) / self.sd;
        -0.5 * z * z + self.log_normalisation()
    }
}
