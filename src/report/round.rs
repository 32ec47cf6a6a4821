//! One identification in `report.json`.

use serde::{Deserialize, Deserializer, Serialize};

use super::json::{Keyed, or_nan, part};
use super::residual::{NoiseReport, ResidualReport};
use super::steps::{LinearityReport, StepReport};
use super::tracing::TracingReport;
use crate::infer::MaterialSpec;
use crate::laminate::MeanSd;
use crate::parameter::{Parameter, ParameterKind};
use crate::posterior::Importance;
pub use crate::quantity::MeanAndSd;

/// One identification, and in a loop what its residual was traced to.
#[derive(Debug, Serialize, Deserialize)]
pub struct RoundReport {
    pub effects_declared: Vec<String>,
    /// Every sampled parameter: constants, amplitudes of mechanical effects (`effect.parameter`), the noise.
    pub posterior: Keyed<PosteriorSummary>,
    /// Amplitudes of all declared effects.
    #[serde(default)]
    pub effect_amplitudes: Keyed<MeanAndSd>,
    pub correlation: Correlation,
    pub convergence: Convergence,
    pub residual: ResidualReport,
    /// What was doubtful of the input before anything was sampled.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
    /// Sentences about results that should not be trusted as they stand.
    #[serde(default)]
    pub warnings: Vec<String>,
    pub noise: NoiseReport,
    /// How the draws fare under the full finite elements; at no draws in reports of earlier versions.
    #[serde(default)]
    pub full_model: Importance,
    /// The steps of a load series.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepReport>,
    /// Whether they are proportional to the load.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linearity: Option<LinearityReport>,
    #[serde(flatten, deserialize_with = "tracing")]
    pub tracing: Option<TracingReport>,
}

fn tracing<'de, D: Deserializer<'de>>(
    rest: D,
) -> std::result::Result<Option<TracingReport>, D::Error> {
    part(rest, "candidates")
}

impl RoundReport {
    /// Names of the elastic constants: sampled parameters that are no effect's amplitude, and not the noise.
    pub fn constants(&self) -> impl Iterator<Item = &str> {
        let names = self.posterior.keys().map(String::as_str);
        names.filter(|name| Parameter::read(name).is(ParameterKind::Constant))
    }

    /// Mean and sd of the constants by this round's model alone.
    pub fn alone(&self) -> Keyed<MeanAndSd> {
        let constants = self.constants().map(|name| (name, &self.posterior[name]));
        constants
            .map(|(name, s)| (name.to_string(), (s.mean, s.sd).into()))
            .collect()
    }

    /// Posterior mean and sd of a sampled parameter or a declared effect's amplitude, border units.
    pub fn moments(&self, name: &str) -> Option<MeanAndSd> {
        let sampled = self.posterior.get(name).map(|s| (s.mean, s.sd).into());
        sampled.or_else(|| self.effect_amplitudes.get(name).copied())
    }
}

/// The marginal posterior of one parameter, border units.
#[derive(Debug, Serialize, Deserialize)]
pub struct PosteriorSummary {
    pub mean: f64,
    pub sd: f64,
    #[serde(rename = "q2.5")]
    pub low: f64,
    pub median: f64,
    #[serde(rename = "q97.5")]
    pub high: f64,
    #[serde(deserialize_with = "or_nan")]
    pub mcse_mean: f64,
    #[serde(deserialize_with = "or_nan")]
    pub rhat: f64,
    #[serde(deserialize_with = "or_nan")]
    pub ess_bulk: f64,
    #[serde(deserialize_with = "or_nan")]
    pub ess_tail: f64,
    /// What the model says that others found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub published: Option<MeanAndSd>,
}

impl MeanAndSd {
    /// What the material's declaration says that others found of a constant.
    pub fn published(material: &MaterialSpec, name: &str) -> Option<Self> {
        let MeanSd { mean, sd } = material.parameters.get(name)?.published?;
        Some(Self { mean, sd })
    }
}

#[derive(Debug, Serialize, Deserialize)]
pub struct Correlation {
    pub names: Vec<String>,
    /// Row by row; `null` for a parameter that does not vary.
    pub matrix: Vec<Vec<Option<f64>>>,
}

/// What the chains are worth. Times count stored draws.
#[derive(Debug, Serialize, Deserialize)]
pub struct Convergence {
    #[serde(deserialize_with = "or_nan")]
    pub rhat_max: f64,
    #[serde(deserialize_with = "or_nan")]
    pub ess_bulk_min: f64,
    #[serde(deserialize_with = "or_nan")]
    pub ess_tail_min: f64,
    #[serde(deserialize_with = "or_nan")]
    pub tau_max: f64,
    /// Whether every parameter satisfies the rule.
    pub converged: bool,
    /// The verdict on the chains in one line.
    pub text: String,
    /// Steps of each ensemble before the first that is stored.
    pub warmup_steps: usize,
    /// Steps from one stored draw to the next.
    pub thin: usize,
    /// What was not stored, in words.
    pub burn_in: String,
    /// Why sampling ended, in words.
    pub stopped: String,
    pub ensembles: usize,
    /// Chains of all ensembles.
    pub chains: usize,
    /// Draws a chain.
    pub draws: usize,
}
