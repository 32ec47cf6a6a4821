//! The line of the load lies beside the plate's centreline.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_moments};
use crate::fem::Setup;

pub struct InPlaneBending;

impl Effect for InPlaneBending {
    fn entry(&self) -> Entry {
        Entry {
            name: "in_plane_bending",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("eccentricity_mm", 0.2, 5.0)] },
            about: "The load acts at a distance from the centreline, so that the plate bends in its plane. The distance is positive towards direction 2, in the frame of the machine.",
            confirm: "Put strain gauges on both edges, far from the hole. Or remount the specimen turned front to back about the loading axis. For the camera, bending from the grips then stays and a thickness taper changes sides.",
        }
    }

    /// End traction N (1 + 12 e t / W^2): a moment F e.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.load.moment += setup.load.axial * amplitude[0];
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_moments(scene)
    }
}
