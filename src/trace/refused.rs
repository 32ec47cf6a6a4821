//! Effects that were added and taken out again.

use super::round::Round;
use super::tracing::Tracing;

/// Effects that were added and taken out again, each with the reason: none is sought again.
#[derive(Debug, Clone, Default)]
pub struct Refused(Vec<(&'static str, String)>);

impl Refused {
    /// These and what a round called for, which did not hold.
    #[must_use]
    pub fn and(mut self, round: &Round, why: String) -> Self {
        let called = round.tracing.accepted.as_ref();
        self.0.extend(called.map(|a| (a.effect.name(), why)));
        self
    }

    pub fn all(&self) -> &[(&'static str, String)] {
        &self.0
    }

    /// Whether an effect has not been refused.
    pub fn may_be_sought(&self, name: &str) -> bool {
        self.0.iter().all(|(n, _)| *n != name)
    }
}

impl Tracing {
    /// The same with what was refused among the effects left out, undecided.
    #[must_use]
    pub fn without(mut self, refused: &Refused) -> Self {
        for (name, why) in refused.all() {
            let known = self.left_out.iter().any(|(n, _)| n == name);
            if !known {
                self.left_out
                    .push((name, format!("added and taken out again: {why}")));
                self.undecided.push(vec![name]);
            }
        }
        self
    }
}
