//! The noise of a measured field: white part, correlated part, restricted likelihood, hyperparameters.

pub mod covariance;
mod estimate;
mod lattice;
mod normal;
mod random_field;
pub mod reml;
pub mod series;
pub mod white;

pub use covariance::{BlockCovariance, Matern};
pub use estimate::{ComponentOfNoise, Noise, residual_of_fit};
pub use normal::NormalEquations;
pub(crate) use normal::solve;
pub use random_field::matern_pair;
pub use reml::Hyperparameters;
pub use white::white;
