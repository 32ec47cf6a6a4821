//! Whether a posterior can be trusted: other ways to the same numbers, and simulated measurements of known truth.

pub mod twin;
