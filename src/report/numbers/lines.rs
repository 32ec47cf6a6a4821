//! Rows of the figures' numbers that follow from `report.json`.

use serde::Serialize;

use crate::report::residual::{ByComponent, ResidualReport};

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

/// RMS of the block averages of a residual somewhere.
#[derive(Debug, Serialize)]
pub struct PlaceRms {
    pub place: String,
    pub u1_nm: f64,
    pub u2_nm: f64,
}

/// Quadrants about the hole by the signs of direction 1, along the load, and direction 2, in the order of `quadrants_nm`.
const QUADRANTS: [&str; 4] = [
    "+1, +2 quadrant",
    "\u{2212}1, +2 quadrant",
    "\u{2212}1, \u{2212}2 quadrant",
    "+1, \u{2212}2 quadrant",
];

/// A residual in rings about the hole and in quadrants.
pub fn places(residual: &ResidualReport) -> Vec<PlaceRms> {
    let mut inner = None;
    let rings = residual.rings.iter().map(|ring| {
        let outer = ring.to_radius_mm;
        let place = match inner.replace(outer) {
            None => format!("up to {outer:.1} mm"),
            Some(inner) => format!("{inner:.1} to {outer:.1} mm"),
        };
        (place, ByComponent::from([ring.u1_nm, ring.u2_nm]))
    });
    let mut places: Vec<_> = rings.collect();
    let quadrants = QUADRANTS.iter().zip(&residual.quadrants_nm);
    places.extend(quadrants.map(|(name, q)| ((*name).to_string(), *q)));
    let line = |(place, ByComponent { u1, u2 })| PlaceRms {
        place,
        u1_nm: u1,
        u2_nm: u2,
    };
    places.into_iter().map(line).collect()
}
