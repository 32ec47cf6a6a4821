//! Drilling has damaged the laminate about the hole.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::{EdgeLoss, Setup};
use crate::quantity::plus_minus;

pub struct HoleEdgeDamage;

/// Depths over the hole's radius of which the damage's own is a mixture (prototype study). Two of a fixed depth each are linear in what was
/// lost, as one of an unknown depth is not.
const DEPTHS: [f64; 2] = [0.12, 0.4];

impl Effect for HoleEdgeDamage {
    fn entry(&self) -> Entry {
        Entry {
            name: "hole_edge_damage",
            kind: Kind::Mechanical,
            parameters: const {
                &[
                    EffectParameter::positive("loss_percent", 20.0, 95.0),
                    EffectParameter::new("deeper_percent", 20.0, 95.0),
                ]
            },
            about: "The laminate has lost `loss_percent` of its stiffness at the hole's edge. Half of the loss fades over 0.12 radii (a factor of e), half over 0.4. Half of `deeper_percent` is added to the deep part and taken from the other.",
            confirm: "Ultrasonic C-scan, or X-ray with a penetrant, about the hole; or ream the damaged ring away, declare the new diameter, and repeat.",
        }
    }

    fn needed(&self) -> usize {
        1
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let [loss, deeper] = [0, 1].map(|k| 0.01 * amplitude[k]);
        let halves = [0.5 * (loss - deeper), 0.5 * (loss + deeper)];
        setup.profile.damage = Some(EdgeLoss {
            parts: [0, 1].map(|k| [halves[k], DEPTHS[k]]),
        });
    }

    /// What is lost at the edge is not negative, nor is what is lost over all depths. Else it would stand in for a smaller hole.
    fn never_negative(&self) -> Option<[f64; 2]> {
        let [near, far] = DEPTHS;
        Some([0.5 * (near + far), 0.5 * (far - near)])
    }

    fn meaning(&self, amplitude: &[[f64; 2]], scene: &Scene) -> Option<String> {
        let radius = scene.setup.geometry.hole_radius()?;
        let [[loss, _], [deeper, sd]] = *amplitude else {
            return None;
        };
        let [near, far] = DEPTHS.map(|depth| depth * radius);
        let depth = |share: f64| 0.5 * (near + far) + 0.5 * share * (far - near);
        let share = (deeper / loss).clamp(-1.0, 1.0);
        let sd = (depth(share + sd / loss.abs()) - depth(share)).min(0.5 * (far - near));
        let depth = plus_minus(depth(share), sd);
        Some(format!(
            "The stiffness that is lost lies {depth} mm from the hole's edge on average"
        ))
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        let hole = scene.setup.geometry.hole_radius();
        hole.is_none()
            .then_some("the specimen's geometry has no hole")
    }
}
