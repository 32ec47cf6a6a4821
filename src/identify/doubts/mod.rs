//! Doubts about the input, before anything is sampled: what the constants would have to be, and which mistake of the input makes that.
//!
//! A mistake is tested as a model file is read: the declared test is changed in one place, linearised on a coarse mesh, and fitted with all
//! effects under their priors. A mistake is named where it is some nats likelier than the input as it stands. With the effects in both fits a
//! load that leans, or a hole that is a little larger, is no reason to doubt the input.

mod examine;
pub mod mistake;

pub use examine::doubts;

/// What is done with doubts about the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Doubting {
    /// They are not looked for.
    #[default]
    Unasked,
    /// They are said, and the run goes on.
    Said,
    /// They end the run.
    Refused,
}

/// Log odds from which on a mistake is named, nats. A common factor of all moduli leaves the same field and has the priors alone against it: of
/// one modulus known to a fifth, half the force makes 3.1.
const NATS: f64 = 8.0;
const NATS_OF_SCALE: f64 = 3.0;
