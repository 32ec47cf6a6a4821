//! One turn of the loop.

use super::tracing::Tracing;
use crate::identify::Identification;
use crate::infer::Model;

/// An identification and what tracing made of its residual.
pub struct Round {
    /// The model that was identified.
    pub model: Model,
    /// The identification.
    pub identification: Identification,
    /// What its residual says.
    pub tracing: Tracing,
}
