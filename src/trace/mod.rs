//! Identification in rounds, and what each leaves unexplained.

mod checks;
mod pose;
mod refine;
mod residual;
mod round;
mod truth;

pub use pose::{Posed, Prepared, pose, posterior, prepare, start};
pub use refine::Refinement;
pub use residual::Residual;
pub use round::{Options, Round, identify};
pub use truth::{Identified, SurrogateError, TOLERANCE, TRUTH_DRAWS};
