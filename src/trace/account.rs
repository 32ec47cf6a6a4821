//! An account of a residual: the evidence, and where the test was linearised for it.

use super::evidence::Evidence;
use crate::effect::Effect;
use crate::experiment::State;
use crate::experiment::series::SeriesState;
use crate::infer::Acts;

/// What was weighed, and about what.
pub struct Account {
    pub evidence: Evidence,
    pub about: About,
}

/// The point about which a test was linearised, and what was sought there.
pub enum About {
    Field {
        /// Constants, thickness, effects that act, border units.
        state: State,
        /// Effects that were candidates.
        sought: Vec<&'static dyn Effect>,
        /// Root mean square of the measured displacements, mm.
        size_mm: f64,
    },
    Series {
        /// Constants, thickness, effects that act, border units, with every step's own.
        state: SeriesState,
        /// Effects of the model and candidates, each by a law.
        declared: Vec<Acts>,
        sought: Vec<Acts>,
    },
}
