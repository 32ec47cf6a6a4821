//! How a loop ended, in `report.json`.

use serde::{Deserialize, Serialize};

use super::json::Keyed;
use crate::trace::Status;

/// How a loop ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VerdictReport {
    pub status: Status,
    /// Effects added, in order.
    #[serde(default)]
    pub effects: Vec<String>,
    /// The alias group of each added effect that has one.
    #[serde(default)]
    pub alias_groups: Vec<Vec<String>>,
    /// Groups that the data speak for without being sure.
    #[serde(default)]
    pub undecided: Vec<Vec<String>>,
    pub text: String,
    /// What would confirm each effect named, and tell it from its stand-ins.
    #[serde(default)]
    pub confirm: Vec<ConfirmReport>,
}

/// The tests that would tell the members of a group apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfirmReport {
    /// Whether the group's leader is part of the last model.
    pub added: bool,
    /// The leader's first.
    pub tests: Vec<TestReport>,
}

impl ConfirmReport {
    /// What the tests would show.
    pub fn question(&self) -> String {
        let leader = self.tests.first().map_or("", |t| &t.effect);
        if self.tests.len() > 1 {
            format!("What would tell {leader} from what could stand in for it")
        } else {
            format!("What would confirm {leader}")
        }
    }
}

/// A test in the laboratory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TestReport {
    pub effect: String,
    pub test: String,
}

/// Figures of the first round and of the last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter {
    pub residual_rms_nm: [Option<f64>; 2],
    pub residual_rms_u1_nm: [Option<f64>; 2],
    pub residual_rms_u2_nm: [Option<f64>; 2],
    pub chi2_reduced: [Option<f64>; 2],
    pub holdout_rms_nm: [Option<f64>; 2],
    /// Every parameter of both models.
    pub posterior: Keyed<Shifted>,
}

/// A parameter before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shifted {
    pub mean: [f64; 2],
    pub sd: [f64; 2],
    /// Change of the mean, sds before.
    pub shift_in_sd: Option<f64>,
    /// Distance of both from the prior's mean, prior sds; `null` for what is no constant.
    pub from_prior_in_prior_sd: [Option<f64>; 2],
}
