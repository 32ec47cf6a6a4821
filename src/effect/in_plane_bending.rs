//! The line of the load lies beside the plate's centreline.

use super::{Effect, Entry, Kind, Parameter, Scene, unless_moments};
use crate::fem::Setup;

pub struct InPlaneBending;

impl Effect for InPlaneBending {
    fn entry(&self) -> Entry {
        Entry {
            name: "in_plane_bending",
            kind: Kind::Mechanical,
            parameters: const { &[Parameter::new("eccentricity_mm", 0.2, 5.0)] },
            about: "The load acts at a distance from the centreline, positive towards direction 2, in the frame of the machine, so that the plate bends in its plane.",
            confirm: "Put strain gauges on both edges, far from the hole. Or remount the specimen turned front to back about the loading axis: as the camera sees it, bending from the grips stays and a thickness taper changes sides.",
        }
    }

    /// End traction N (1 + 12 e t / W^2): a moment F e.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.load.moment += setup.load.axial * amplitude[0];
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        unless_moments(scene)
    }
}
