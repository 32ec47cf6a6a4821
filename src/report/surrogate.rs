//! The reduced model in `report.json`.

use serde::{Deserialize, Serialize};

use super::json::Keyed;
use crate::reduce::Choice;

/// The reduced model: what it is made of.
#[derive(Debug, Serialize, Deserialize)]
pub struct SurrogateReport {
    /// Whether the snapshots are another program's: what stands for the finite elements then are surfaces through them of more modes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub supplied: bool,
    pub variables: Choice,
    pub modes: usize,
    /// Low and high side of the box.
    pub doe: Keyed<[f64; 2]>,
    /// Predicted residual error of each coefficient.
    #[serde(default)]
    pub press_mm: Vec<f64>,
    pub cached: bool,
}
