//! The load's resultant leans towards direction 2.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_moments};
use crate::fem::Setup;

pub struct LoadMisalignment;

impl Effect for LoadMisalignment {
    fn entry(&self) -> Entry {
        Entry {
            name: "load_misalignment",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("angle_deg", 1.0, 20.0)] },
            about: "The pull through the plate's centre leans by the angle from direction 1 towards direction 2, in the frame of the machine. The ends carry shear, and the moments that balance it.",
            confirm: "Measure the offset between the upper and the lower grip across the load, with a plumb line or a dial gauge. It is the free length times the tangent of the angle. Or remount the specimen turned front to back about the loading axis. For the camera, the angle of the load then stays and that of the plies changes its sign.",
        }
    }

    /// End shear F sin a, parabolic, with end moments +-F (L/2) sin a; axial F cos a.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let (sin, cos) = amplitude[0].to_radians().sin_cos();
        setup.load.shear += setup.load.axial * sin;
        setup.load.axial *= cos;
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_moments(scene)
    }
}
