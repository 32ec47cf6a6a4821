//! Where the plate is stiffer or more compliant than the nominal laminate.

use super::mesh::Outline;
use crate::error::{Error, Result};

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

    /// Outer radius of the ring about the hole, mm.
    pub fn ring(&self, outline: &Outline) -> Option<f64> {
        self.annulus.map(|ring| ring.reach * outline.radius)
    }

    /// The factor at a point.
    pub fn factor(&self, outline: &Outline, p: [f64; 2]) -> f64 {
        let along = self.along * from_middle(outline.s, p[0]);
        let across = self.across * from_middle(outline.t, p[1]);
        let ring = self.ring(outline).unwrap_or(0.0);
        let left = if p[0].hypot(p[1]) < ring {
            1.0 - self.loss()
        } else {
            1.0
        };
        (1.0 + along) * (1.0 + across) * left
    }

    /// Check that some stiffness is left everywhere, and that the ring stays clear of the edges by at least a
    /// twentieth of the hole's radius.
    ///
    /// # Errors
    /// A factor that comes near to 0 or below, or a ring that an edge would cut.
    pub fn validate(&self, outline: &Outline) -> Result<()> {
        let widening = outline.clamp.map_or(1.0, |clamp| clamp.widening);
        let least = (1.0 - 0.5 * self.along.abs())
            .min(1.0 - 0.5 * self.across.abs() * widening)
            .min(1.0 - self.loss());
        if !(least >= LEAST && self.loss().is_finite()) {
            return Err(
                Error::input("plate stiffness", "a plate that is stiff everywhere")
                    .found(format!("a factor of {least:.3} at its smallest")),
            );
        }
        let nearest = outline.clearance();
        if let Some(ring) = self.ring(outline)
            && nearest - ring < 0.05 * outline.radius
        {
            return Err(Error::input(
                "plate stiffness",
                "a ring about the hole that stays clear of the plate's edge",
            )
            .found(format!(
                "radius {ring} mm with an edge {nearest} mm from the hole's centre"
            )));
        }
        Ok(())
    }

    fn loss(&self) -> f64 {
        self.annulus.map_or(0.0, |ring| ring.loss)
    }
}

/// Distance from the middle of an interval over its length.
fn from_middle([low, high]: [f64; 2], x: f64) -> f64 {
    (x - 0.5 * (low + high)) / (high - low)
}
