//! MCMC-first inference of ply elastic constants from full-field displacement measurements.

pub mod chain;
pub mod diagnose;
pub mod error;
pub mod infer;
pub mod quantity;
pub mod sample;
