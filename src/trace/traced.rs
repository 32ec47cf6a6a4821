//! What tracing rests on: the evidence, and the point about which the test was linearised for it.

use serde::Serialize;

use super::evidence::Evidence;
use crate::identify::made_of;
use crate::infer::Model;
use crate::posterior::LinearisationPoint;

/// What was weighed, and about what.
pub struct LinearisedEvidence {
    pub evidence: Evidence,
    pub point: LinearisationPoint,
}

impl LinearisedEvidence {
    /// All that a stage is made of which goes on from here.
    pub fn made_of<'a>(&'a self, model: &'a Model) -> impl Serialize + 'a {
        let test = made_of(model, &self.evidence.measured);
        (test, &self.point, &self.evidence.sensitivities)
    }
}
