//! MCMC-first inference of ply elastic constants from full-field displacement measurements.

pub mod error;
pub mod fem;
pub mod infer;
pub mod laminate;
pub mod quantity;
