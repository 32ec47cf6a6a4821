//! One identification: inverse problem, sample, residual, checks.

mod checks;
pub mod fringes;
mod identification;
mod inverse;
pub mod jumps;
mod patterns;
pub mod phase;
mod refine;
mod residual;
mod structure;
mod surrogate;
mod waves;

pub use checks::PRIOR_SDS;
pub use identification::{Identification, Options, identify};
pub use inverse::{InverseProblem, Prepared, inverse_problem, is_clear, posterior, prepare, start};
pub use patterns::{Exceedance, Patterns};
pub use refine::{Refinement, refined};
pub use residual::Residual;
pub use structure::Structure;
pub use surrogate::{CHECKED_DRAWS, Reweighted, SurrogateError, TOLERANCE};
pub use waves::Wave;
