//! One identification: inverse problem, sample, residual, checks.

mod coarse;
pub mod doubts;
mod fields;
mod force;
mod forward;
pub mod fringes;
mod identification;
mod inverse;
pub mod jumps;
mod misfit;
mod own_rotation;
mod patterns;
pub mod phase;
mod prepared;
mod reduction;
mod residual;
mod size;
mod solve;
mod tiles;
mod warnings;
mod weighed;

pub use coarse::CoarseTest;
pub use force::settle_force;
pub use forward::{forward, over_blocks};
pub use identification::Identification;
pub use inverse::{InverseProblem, blocks_of, inverse_problem, reaches, start};
pub use misfit::MISFIT;
pub use patterns::Patterns;
pub use prepared::{Begun, Prepared, is_clear, prepare};
pub use residual::Residual;
pub use solve::{Options, Reporting, checked, identify, identify_from, redrawn};
pub use warnings::PRIOR_SDS;
pub use weighed::{NumberedPoint, made_of, weighed};
