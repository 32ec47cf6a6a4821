//! Identification in rounds, and what each leaves unexplained.

mod checks;
pub mod jumps;
pub mod phase;
mod refine;
mod residual;
mod round;
mod truth;

pub use refine::Refinement;
pub use residual::Residual;
pub use round::{Options, Prepared, Round, identify, prepare};
pub use truth::{SurrogateError, TOLERANCE, TRUTH_DRAWS};
