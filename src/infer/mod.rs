//! Prior, likelihood and posterior.

mod density;

pub use density::LogDensity;
