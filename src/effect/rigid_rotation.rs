//! Small rigid rotation of the specimen in its plane.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::quantity::URAD_PER_RAD;

pub struct RigidRotation;

impl Effect for RigidRotation {
    fn entry(&self) -> Entry {
        Entry {
            name: "rigid_rotation",
            kind: Kind::Additive,
            parameters: const { &[EffectParameter::new("angle_urad", 100.0, 1e4)] },
            about: "The specimen turned in its plane between the two exposures; counter-clockwise in the data's x-y plane is positive.",
            confirm: "Unload, unclamp, clamp anew and repeat: the angle changes while the constants stay; or track two marks on each grip between the exposures.",
        }
    }

    fn is_rigid(&self) -> bool {
        true
    }

    /// Loading along y: u1 += w x, u2 -= w y.
    fn displacement(&self, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let angle = scene.frame.handedness() * amplitude[0] / URAD_PER_RAD;
        [-angle * t, angle * s]
    }
}
