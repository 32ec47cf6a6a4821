//! Effects in `report.json`: what a residual was traced to, and what could hide in it.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::json::{Keyed, nan, or_nan};
use crate::experiment::series::{Law, with_law};
use crate::trace::Interval;

#[derive(Debug, Serialize, Deserialize)]
pub struct TracingReport {
    /// Effects weighed, the most probable first.
    pub candidates: Vec<CandidateReport>,
    /// Alias groups of the best subset, the strongest first.
    #[serde(default)]
    pub groups: Vec<AliasGroupReport>,
    /// The effect that was called for, if one was.
    #[serde(default)]
    pub accepted: Vec<String>,
    /// Groups that the data speak for without being sure.
    #[serde(default)]
    pub undecided: Vec<Vec<String>>,
    /// Probability of smooth structure that no effect explains.
    #[serde(default = "nan", deserialize_with = "or_nan")]
    pub discrepancy_probability: f64,
    /// The constants averaged over what may act unseen.
    #[serde(default)]
    pub averaged_posterior: Keyed<Interval>,
    #[serde(default)]
    pub left_out: Vec<LeftOut>,
}

/// An effect weighed against the residual.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CandidateReport {
    pub effect: String,
    /// How its amplitude goes over the steps of a series.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    /// Posterior probability that it acts.
    pub inclusion_probability: f64,
    #[serde(deserialize_with = "or_nan")]
    pub log_bayes_factor: f64,
    pub amplitude: Vec<AmplitudeReport>,
    /// Largest amplitude over its prior sd.
    #[serde(default = "nan", deserialize_with = "or_nan")]
    pub plausible_multiple: f64,
    /// Whether that is too much.
    #[serde(default)]
    pub implausible: bool,
    /// Share of the structured part of chi^2 that it explains alone.
    #[serde(deserialize_with = "or_nan")]
    pub explained_fraction: f64,
    /// Smallest amplitude that would have been found; `null` if none would.
    #[serde(deserialize_with = "or_nan")]
    pub detectable: f64,
    pub aliases: Vec<AliasReport>,
}

/// An amplitude, border units.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AmplitudeReport {
    pub parameter: String,
    pub mean: f64,
    pub sd: f64,
}

/// An effect of similar signature.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AliasReport {
    pub effect: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    pub cosine: f64,
}

/// Effects that the data cannot tell apart.
#[derive(Debug, Serialize, Deserialize)]
pub struct AliasGroupReport {
    /// The member with the largest evidence.
    pub leader: String,
    /// How its amplitude goes over the steps of a series, as far as the evidence tells.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<Law>,
    /// All single members.
    pub members: Vec<String>,
    /// Pairs that together could stand in.
    pub pairs: Vec<[String; 2]>,
    /// Effects outside the group that leave almost the same field, with the amplitudes that they would need: written for others to read.
    #[serde(default)]
    pub resembling: Vec<Value>,
    /// Probability that some member acts.
    pub probability: f64,
    /// Log evidence lost when the group is dropped.
    #[serde(deserialize_with = "or_nan")]
    pub log_evidence_lost_without: f64,
    /// Whether held-out blocks are predicted better with it.
    pub predicts_held_out_blocks: bool,
}

/// An effect that was not weighed.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    pub effect: String,
    pub reason: String,
}

impl CandidateReport {
    /// The effect with its law.
    pub fn name(&self) -> String {
        with_law(&self.effect, self.law)
    }
}

impl AliasReport {
    /// The effect with its law.
    pub fn name(&self) -> String {
        with_law(&self.effect, self.law)
    }
}
