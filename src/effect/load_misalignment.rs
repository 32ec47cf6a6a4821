//! The load's resultant leans towards direction 2.

use super::{Effect, Entry, Kind, Parameter, Scene, unless_moments};
use crate::fem::Setup;

pub struct LoadMisalignment;

impl Effect for LoadMisalignment {
    fn entry(&self) -> Entry {
        Entry {
            name: "load_misalignment",
            kind: Kind::Mechanical,
            parameters: const { &[Parameter::new("angle_deg", 1.0, 20.0)] },
            about: "The pull through the plate's centre leans by the angle from direction 1 towards direction 2, in the frame of the machine: end shear, with the end moments that balance it.",
            confirm: "Measure the offset between the upper and the lower grip across the load (plumb line or dial gauge): the free length times the tangent of the angle. Or remount the specimen turned front to back about the loading axis: as the camera sees it, the angle of the load stays and that of the plies changes its sign.",
        }
    }

    /// End shear F sin a, parabolic, with end moments +-F (L/2) sin a; axial F cos a.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let (sin, cos) = amplitude[0].to_radians().sin_cos();
        setup.load.shear += setup.load.axial * sin;
        setup.load.axial *= cos;
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        unless_moments(scene)
    }
}
