//! One identification: inverse problem, sample, residual, checks.

pub mod doubts;
mod force;
pub mod fringes;
mod identification;
mod inverse;
pub mod jumps;
mod misfit;
mod of_frames;
mod own_rotation;
mod patterns;
pub mod phase;
mod reduction;
mod refine;
mod residual;
mod series;
mod size;
mod solve;
mod structure;
mod surrogate;
mod tiles;
mod warnings;
pub mod waves;

pub use force::settle_force;
pub use identification::{Identification, Refinement};
pub use inverse::{InverseProblem, Prepared, inverse_problem, is_clear, posterior, prepare, start};
pub use misfit::MISFIT;
pub use patterns::Patterns;
pub use refine::refined;
pub use residual::Residual;
pub use solve::{Options, Reporting, identify, identify_traced, redrawn, refine};
pub use structure::{RingRms, Structure, VariogramLag};
pub use surrogate::{CHECKED_DRAWS, SurrogateError, TOLERANCE};
pub use warnings::PRIOR_SDS;
