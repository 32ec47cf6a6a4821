//! Drilling has damaged the laminate about the hole.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_offered};
use crate::fem::{Annulus, Setup};
use crate::geometry::Change;

pub struct HoleEdgeDamage;

/// Outer radius of the damaged ring over the hole's radius.
const REACH: f64 = 1.3;

impl Effect for HoleEdgeDamage {
    fn entry(&self) -> Entry {
        Entry {
            name: "hole_edge_damage",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::positive("loss_percent", 20.0, 95.0)] },
            about: "The laminate within 1.3 radii of the hole's centre has lost this percentage of its stiffness.",
            confirm: "Ultrasonic C-scan, or X-ray with a penetrant, about the hole; or ream the damaged ring away, declare the new diameter, and repeat.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.profile.annulus = Some(Annulus {
            reach: REACH,
            loss: 0.01 * amplitude[0],
        });
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        unless_offered(scene, Change::Ring)
    }
}
