//! The point about which a test is linearised.

use serde::{Deserialize, Serialize};

use crate::experiment::series::SeriesState;
use crate::infer::EffectUnderLaw;

/// The point about which a test was linearised, and what was sought there.
#[derive(Clone, Serialize, Deserialize)]
pub struct LinearisationPoint {
    /// Constants, thickness, effects that act, border units, with every step's own.
    pub state: SeriesState,
    /// Effects of the model and candidates, each by a law where it has one.
    pub declared: Vec<EffectUnderLaw>,
    pub sought: Vec<EffectUnderLaw>,
}
