//! Rows of the figures' numbers that follow from `report.json`.

use serde::Serialize;

/// A 95 % interval of a constant, border units.
#[derive(Debug, Serialize)]
pub struct IntervalLine {
    pub parameter: String,
    /// Whose interval it is.
    pub what: String,
    pub mean: f64,
    pub low: f64,
    pub high: f64,
    /// The true value, where it is known.
    pub truth: f64,
}

/// An effect weighed against the residual.
#[derive(Debug, Serialize)]
pub struct CandidateLine<'a> {
    pub effect: &'a str,
    pub inclusion_probability: f64,
    pub log_bayes_factor: f64,
    pub explained_fraction: f64,
    pub detectable: f64,
    pub accepted: bool,
}
