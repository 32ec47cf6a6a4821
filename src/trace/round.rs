//! One turn of the loop.

use super::tracing::Tracing;
use crate::identify::Identification;
use crate::infer::Model;

/// An identification and what tracing made of its residual.
pub struct Round {
    pub model: Model,
    pub identification: Identification,
    pub tracing: Tracing,
}
