//! What tracing rests on: the evidence, and the point about which the test was linearised for it.

use super::evidence::Evidence;
use crate::files::Stored;
use crate::identify::bytes_of;
use crate::infer::Model;
use crate::posterior::LinearisationPoint;

/// What was weighed, and about what.
pub struct Traced {
    pub evidence: Evidence,
    pub point: LinearisationPoint,
}

impl Traced {
    /// The bytes of all that a stage is made of which goes on from here.
    pub fn bytes(&self, model: &Model) -> Vec<u8> {
        let mut of = bytes_of(model, &self.evidence.measured);
        self.point.put(&mut of);
        self.evidence.sensitivities.put(&mut of);
        of
    }
}
