//! One turn of the loop.

use super::traced::Traced;
use super::tracing::{MISFIT, Tracing};
use crate::identify::{Identification, Patterns};
use crate::infer::Model;

/// An identification and what tracing made of its residual.
pub struct Round {
    /// The number of the attempt that it was: some are taken back.
    pub attempt: usize,
    pub model: Model,
    pub identification: Identification,
    pub tracing: Tracing,
    /// What the tracing rests on.
    pub traced: Traced,
}

impl Round {
    /// What of the residual stationary noise does not do. The one field of a series is held against noise of short lengths: where the
    /// series' own noise, which may be smooth, explains its misfit, a place where that breaks out is none.
    pub fn patterns(&self) -> Patterns {
        let mut found = self.identification.patterns.clone();
        let misfit = self.tracing.series.as_ref().and_then(|s| s.misfit);
        if misfit.is_some_and(|p| p >= MISFIT) {
            found.exceedance = None;
        }
        found
    }
}
