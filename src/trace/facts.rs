//! The facts that a verdict rests on: the status and what is said of it follow from the same.

use serde::{Deserialize, Serialize};

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The residual is what the noise explains, and no effect was added.
    NothingMissing,
    /// Effects were added, and the residual is now what the noise explains, or noise and an effect on which the data do not decide.
    Closed,
    /// Structure remains that no effect of the dictionary explains, or that an effect does which was not added, or a pattern
    /// that stationary noise does not have.
    Unexplained,
}

impl Status {
    pub fn words(self) -> &'static str {
        match self {
            Self::NothingMissing => "nothing missing",
            Self::Closed => "closed",
            Self::Unexplained => "unexplained",
        }
    }
}

/// What of a residual a loop has found, and what it has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerdictFacts {
    /// Effects were added.
    pub added: bool,
    /// An effect is called for that was not added.
    pub wanted: bool,
    /// Smooth structure is left that no effect explains.
    pub structure: bool,
    /// What is left has patterns that stationary noise has not.
    pub patterns: bool,
    /// Something speaks for an effect without being sure.
    pub undecided: bool,
    /// Something speaks against the account.
    pub objections: bool,
}

impl VerdictFacts {
    /// How the loop ended.
    pub fn status(self) -> Status {
        let open = self.wanted || self.structure || self.patterns || self.objections;
        match (open, self.added) {
            (true, _) => Status::Unexplained,
            (false, true) => Status::Closed,
            (false, false) => Status::NothingMissing,
        }
    }

    /// What is said of that; nothing where a sentence of its own says what is left.
    pub fn words(self) -> Option<&'static str> {
        match self.status() {
            Status::NothingMissing if self.undecided => Some(
                "The measured noise explains the residual well enough: no effect is sure enough to be called for.",
            ),
            Status::NothingMissing => Some(
                "The residual is what the measured noise explains: nothing asks for another effect.",
            ),
            Status::Closed => Some("What is left is what the measured noise explains."),
            Status::Unexplained if self.structure => Some(
                "Structure is left that no effect of the dictionary explains; the averaged posterior counts it as a smooth discrepancy.",
            ),
            // the effect that was not added, and patterns, have sentences of their own
            Status::Unexplained if self.wanted || self.patterns => None,
            Status::Unexplained => {
                Some("The account of the residual does not stand, for the reasons below.")
            }
        }
    }
}
