//! One turn of the loop.

use super::account::Account;
use super::tracing::Tracing;
use crate::identify::Identification;
use crate::infer::Model;

/// An identification and what tracing made of its residual.
pub struct Round {
    /// The number of the attempt that it was: some are taken back.
    pub attempt: usize,
    pub model: Model,
    pub identification: Identification,
    pub tracing: Tracing,
    /// What the tracing rests on.
    pub account: Account,
}
