//! Identification in rounds, and what each leaves unexplained.

mod alias;
mod attribute;
mod averaged;
mod checks;
mod close;
mod conclude;
mod find;
mod fringes;
mod holdout;
pub mod jumps;
pub mod phase;
mod pose;
mod refine;
mod residual;
mod round;
mod state;
mod subsets;
mod tangents;
mod truth;
mod verdict;
mod weighing;

pub use attribute::{Found, Named, Resembling, Tracing, attribute, candidates};
pub use averaged::{Averaged, BlindSpot};
pub use checks::PRIOR_SDS;
pub use close::{Closed, Step, close, extended};
pub use find::Structure;
pub use pose::{Posed, Prepared, pose, posterior, prepare, start};
pub use refine::{Refinement, refined};
pub use residual::Residual;
pub use round::{Options, Round, identify};
pub use state::State;
pub use truth::{Identified, Reweighted, SurrogateError, TOLERANCE, TRUTH_DRAWS};
pub use verdict::{Conclusion, Confirming, Status};
