//! MCMC-first inference of ply elastic constants from full-field displacement measurements.

pub mod error;
pub mod field;
pub mod infer;
pub mod quantity;
