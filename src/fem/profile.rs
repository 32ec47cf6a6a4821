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
    /// Stiffness that is lost about the hole.
    pub damage: Option<EdgeLoss>,
}

/// What a hole's edge has lost of its stiffness, fading into the plate: a factor of 1 less the sum of loss exp(-(r - R) / (depth R)) at a
/// distance r from the centre of a hole of radius R.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeLoss {
    /// Relative loss at the edge, and the distance over which it falls by e, over the hole's radius, of every part.
    pub parts: [[f64; 2]; 2],
}

impl EdgeLoss {
    fn is_nothing(&self) -> bool {
        self.parts.iter().all(|[loss, _]| *loss == 0.0)
    }

    /// What is left of the stiffness so many radii from the hole's centre.
    fn left(&self, radii: f64) -> f64 {
        let lost = |[loss, depth]: [f64; 2]| loss * ((1.0 - radii) / depth).min(0.0).exp();
        1.0 - self.parts.map(lost).iter().sum::<f64>()
    }
}

/// Smallest factor on the stiffness that is still solved for.
const LEAST: f64 = 0.01;

impl Profile {
    /// Whether the factor is 1 everywhere.
    pub fn is_uniform(&self) -> bool {
        let undamaged = self.damage.is_none_or(|loss| loss.is_nothing());
        self.across == 0.0 && self.along == 0.0 && undamaged
    }

    /// The factor at a point.
    pub fn factor(&self, geometry: &dyn Geometry, p: [f64; 2]) -> f64 {
        let [s, t] = geometry.extents();
        let along = self.along * from_middle(s, p[0]);
        let across = self.across * from_middle(t, p[1]);
        let damage = self.damage.zip(geometry.hole_radii(p));
        let left = damage.map_or(1.0, |(loss, radii)| loss.left(radii));
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
        self.damage.map_or(0.0, |damage| {
            let lost = damage.parts.map(|[loss, _]| loss.max(0.0));
            lost.iter().sum()
        })
    }
}

/// Distance from the middle of an interval over its length.
fn from_middle([low, high]: [f64; 2], x: f64) -> f64 {
    (x - 0.5 * (low + high)) / (high - low)
}
