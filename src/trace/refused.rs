//! Effects that were added and taken out again.

use super::round::Round;
use super::tracing::Tracing;

/// Effects that were added and taken out again, each with the reason, once for each time.
#[derive(Debug, Clone, Default)]
pub struct Refused(Vec<(&'static str, String)>);

/// An effect that is refused so often is not traced any more.
const REFUSALS: usize = 2;

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

    /// Whether an effect has not been refused for good.
    pub fn may_be_sought(&self, name: &str) -> bool {
        self.0.iter().filter(|(n, _)| *n == name).count() < REFUSALS
    }
}

impl Tracing {
    /// The same with what was refused for good among the effects left out, undecided.
    #[must_use]
    pub fn without(mut self, refused: &Refused) -> Self {
        for (name, why) in refused.all() {
            let known = self.left_out.iter().any(|(n, _)| n == name);
            if !refused.may_be_sought(name) && !known {
                self.left_out
                    .push((name, format!("added and taken out again: {why}")));
                self.undecided.push(vec![name]);
            }
        }
        self
    }
}
