//! The first and the last round of a loop beside each other, in `report.json`.

use serde::{Deserialize, Serialize};

use super::json::{Keyed, or_nan};

/// Figures of the first round and of the last.
#[derive(Debug, Serialize, Deserialize)]
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
#[derive(Debug, Serialize, Deserialize)]
pub struct Shifted {
    pub mean: [f64; 2],
    pub sd: [f64; 2],
    /// Change of the mean, sds before.
    #[serde(deserialize_with = "or_nan")]
    pub shift_in_sd: f64,
    /// Distance of both from the prior's mean, prior sds; `null` for what is no constant.
    pub from_prior_in_prior_sd: [Option<f64>; 2],
}
