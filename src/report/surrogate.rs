//! The reduced model in `report.json`.

use serde::{Deserialize, Serialize};

use super::json::Keyed;
use crate::reduce::Choice;

/// The reduced model's own error, measured by the finite elements at draws of the posterior.
#[derive(Debug, Serialize, Deserialize)]
pub struct SurrogateReport {
    /// Largest shift of any parameter, posterior sds.
    pub max_error_in_posterior_sd: f64,
    pub error_in_posterior_sd: Keyed<f64>,
    /// Mean shift of each: what does not average out.
    #[serde(default)]
    pub bias_in_posterior_sd: Keyed<f64>,
    /// Draws at which the finite elements were solved.
    pub truth_draws: usize,
    /// Whether the snapshots are another program's: what stands for the finite elements then are surfaces through them of more modes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub supplied: bool,
    pub field_error_nm: FieldErrorReport,
    pub variables: Choice,
    pub modes: usize,
    /// Low and high side of the box.
    pub doe: Keyed<[f64; 2]>,
    /// Predicted residual error of each coefficient.
    #[serde(default)]
    pub press_mm: Vec<f64>,
    pub cached: bool,
}

impl SurrogateReport {
    /// What the reduced model is held against.
    pub fn truth(&self) -> &'static str {
        match self.supplied {
            true => "surfaces of more modes through the supplied snapshots",
            false => "the finite elements",
        }
    }
}

/// Error of a field, nm.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FieldErrorReport {
    pub max: f64,
    pub rms: f64,
}
