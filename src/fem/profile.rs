//! Where the plate is stiffer or more compliant than the nominal laminate.

use crate::error::{Error, Result};
use crate::geometry::Geometry;

/// A factor on the laminate's stiffness that varies over the plate. The default is 1 everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Profile {
    /// Relative change of the thickness from edge to edge: h (1 + across t' / W), t' from the plate's centreline.
    pub across: f64,
    /// Relative change of the thickness from end to end: h (1 + along s' / L), s' from the plate's mid-length.
    pub along: f64,
    /// A ring about the hole that has lost stiffness.
    pub annulus: Option<Annulus>,
}

/// A ring about the hole whose stiffness is multiplied by 1 - loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Annulus {
    /// Outer radius of the ring over the hole's.
    pub reach: f64,
    /// Relative loss of stiffness.
    pub loss: f64,
}

/// Smallest factor on the stiffness that is still solved for.
const LEAST: f64 = 0.01;

impl Profile {
    /// Whether the factor is 1 everywhere.
    pub fn is_uniform(&self) -> bool {
        self.across == 0.0 && self.along == 0.0 && self.loss() == 0.0
    }

    /// The factor at a point.
    pub fn factor(&self, geometry: &dyn Geometry, p: [f64; 2]) -> f64 {
        let [s, t] = geometry.extents();
        let along = self.along * from_middle(s, p[0]);
        let across = self.across * from_middle(t, p[1]);
        let left = match (self.annulus, geometry.hole_radii(p)) {
            (Some(ring), Some(radii)) if radii < ring.reach => 1.0 - ring.loss,
            _ => 1.0,
        };
        (1.0 + along) * (1.0 + across) * left
    }

    /// Check that some stiffness is left everywhere.
    ///
    /// # Errors
    /// A factor that comes near to 0 or below.
    pub fn validate(&self, geometry: &dyn Geometry) -> Result<()> {
        let least = (1.0 - 0.5 * self.along.abs())
            .min(1.0 - 0.5 * self.across.abs() * geometry.widening())
            .min(1.0 - self.loss());
        if least >= LEAST && self.loss().is_finite() {
            return Ok(());
        }
        Err(
            Error::input("plate stiffness", "a plate that is stiff everywhere")
                .found(format!("a factor of {least:.3} at its smallest")),
        )
    }

    fn loss(&self) -> f64 {
        self.annulus.map_or(0.0, |ring| ring.loss)
    }
}

/// Distance from the middle of an interval over its length.
fn from_middle([low, high]: [f64; 2], x: f64) -> f64 {
    (x - 0.5 * (low + high)) / (high - low)
}
