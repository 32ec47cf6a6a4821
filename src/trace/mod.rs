//! Identification in rounds, and what each leaves unexplained.

mod residual;
mod round;

pub use residual::Residual;
pub use round::{Options, Prepared, Round, identify, prepare};
