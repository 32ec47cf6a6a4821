//! The reduced model in `report.json`.

use serde::{Deserialize, Serialize};

/// The surface of the mean: what it is made of.
#[derive(Debug, Serialize, Deserialize)]
pub struct SurrogateReport {
    /// Whether the snapshots are another program's: what stands for the finite elements then are surfaces through them of more modes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub supplied: bool,
    /// Modes of the surface of the mean.
    pub modes: usize,
}
