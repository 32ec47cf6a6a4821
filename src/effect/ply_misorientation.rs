//! All plies are turned against the specimen's axis.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;
use crate::laminate::Material;

pub struct PlyMisorientation;

impl Effect for PlyMisorientation {
    fn entry(&self) -> Entry {
        Entry {
            name: "ply_misorientation",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("angle_deg", 1.0, 45.0)] },
            about: "All ply angles are off by one angle, counter-clockwise in the data's x-y plane, in the frame of the specimen. A balanced laminate then couples extension and shear.",
            confirm: "Measure the fibres' angles against the cut edge on a piece that is sectioned or burnt off. Or remount the specimen turned front to back about the loading axis. For the camera, the angle of the plies then changes its sign and that of the load stays. Turned end for end, both stay.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.turn_plies(setup.handedness * amplitude[0].to_radians());
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        (scene.material == Material::Isotropic).then_some("an isotropic plate has no ply angles")
    }
}
