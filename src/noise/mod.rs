//! The noise of a measured field: white part, correlated part, restricted likelihood, hyperparameters.

pub mod covariance;
mod estimate;
mod hyperparameters;
mod lattice;
mod normal;
mod random_field;
pub mod reml;
pub mod white;

pub use covariance::{BlockCovariance, Matern};
pub use estimate::{Discrepancy, Noise, component, residual_of_fit};
pub(crate) use normal::{invert, solve};
pub use random_field::matern_pair;
pub use reml::Reml;
pub use white::white;
