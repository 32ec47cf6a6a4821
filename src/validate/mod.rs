//! Whether a posterior can be trusted: other ways to the same numbers, and simulated measurements of known truth.

pub mod calibration;
pub mod coverage;
pub mod design;
pub mod drawn;
pub mod grid;
pub mod plan;
pub mod priors;
pub mod quadrature;
pub mod thickness;
