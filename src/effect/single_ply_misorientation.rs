//! One ply is turned against the others.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_own_plies};
use crate::fem::Setup;

/// The first ply of the `0`-th different angle of the layup, counted from 0: which of several plies of the same angle is turned, a
/// field in the plane does not tell.
pub struct SinglePlyMisorientation(pub usize);

const NAMES: [&str; 3] = [
    "single_ply_misorientation_1",
    "single_ply_misorientation_2",
    "single_ply_misorientation_3",
];

/// Index of the first ply of each different angle.
fn different(angles: &[f64]) -> Vec<usize> {
    let is_new = |&k: &usize| !angles[..k].iter().any(|a| (a - angles[k]).abs() < 1e-9);
    (0..angles.len()).filter(is_new).collect()
}

impl Effect for SinglePlyMisorientation {
    fn entry(&self) -> Entry {
        Entry {
            name: NAMES[self.0],
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("angle_deg", 2.0, 45.0)] },
            about: "One ply is off by this angle, counter-clockwise in the data's x-y plane. The number counts the different angles of the layup. The bending that an unsymmetric laminate adds is not modelled.",
            confirm: "Measure the angle of every ply on a polished cut, or burn the matrix off and lay the plies out. A laminate with one ply turned also warps when it cools.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        if let Some(&ply) = different(&setup.angles).get(self.0) {
            setup.angles[ply] += setup.handedness * amplitude[0].to_radians();
        }
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if let Some(obstacle) = unless_own_plies(scene) {
            return Some(obstacle);
        }
        let angles = &scene.setup.angles;
        if angles.len() < 2 {
            return Some("a single ply is all plies");
        }
        (different(angles).len() <= self.0).then_some("the layup has fewer different angles")
    }
}
