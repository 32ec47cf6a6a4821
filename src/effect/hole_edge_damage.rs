//! Drilling has damaged the laminate about the hole.

use super::{Companions, Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::{EdgeLoss, Setup};
use crate::quantity::significant;

pub struct HoleEdgeDamage;

/// Depth of the damage over the hole's radius, before the data tell: between the two depths, 0.12 and 0.4, of a prototype study.
const DEPTH: f64 = 0.22;

impl Effect for HoleEdgeDamage {
    fn entry(&self) -> Entry {
        Entry {
            name: "hole_edge_damage",
            kind: Kind::Mechanical,
            parameters: const {
                &[
                    EffectParameter::positive("loss_percent", 20.0, 95.0),
                    EffectParameter::new("depth_doublings", 0.8, 2.5),
                ]
            },
            about: "The laminate has lost this percentage of its stiffness at the hole's edge. The loss falls by e over a depth of 0.22 radii, or of that doubled so many times.",
            confirm: "Ultrasonic C-scan, or X-ray with a penetrant, about the hole; or ream the damaged ring away, declare the new diameter, and repeat.",
        }
    }

    fn needed(&self) -> usize {
        1
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.profile.worn = Some(EdgeLoss {
            loss: 0.01 * amplitude[0],
            depth: DEPTH * amplitude[1].exp2(),
        });
    }

    fn companions(&self) -> Companions {
        Companions::Centre
    }

    fn meaning(&self, amplitude: &[[f64; 2]], scene: &Scene) -> Option<String> {
        let radius = scene.setup.geometry.hole_radius()?;
        let [doublings, sd] = *amplitude.get(1)?;
        let depth = |by: f64| {
            let depth = radius * DEPTH * (doublings + by).exp2();
            significant(depth, 0.1 * depth)
        };
        Some(format!(
            "A third of the lost stiffness is left {} to {} mm from the hole's edge",
            depth(-sd),
            depth(sd)
        ))
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        let hole = scene.setup.geometry.hole_radius();
        hole.is_none()
            .then_some("the specimen's geometry has no hole")
    }
}
