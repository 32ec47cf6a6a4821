//! The hole was drilled beside its place.

use super::{Effect, Kind, Parameter, Scene, unless_offered};
use crate::fem::Setup;
use crate::geometry::Change;

pub struct HoleOffset;

impl Effect for HoleOffset {
    fn name(&self) -> &'static str {
        "hole_offset"
    }

    fn parameters(&self) -> &'static [Parameter] {
        const {
            &[
                Parameter::new("dx_mm", 0.3, 1e3),
                Parameter::new("dy_mm", 0.3, 1e3),
            ]
        }
    }

    fn kind(&self) -> Kind {
        Kind::Mechanical
    }

    fn about(&self) -> &'static str {
        "The hole lies (dx, dy) along the data's x and y from its nominal place in the plate; the data's origin stays at its centre."
    }

    fn confirm(&self) -> &'static str {
        "Measure the distance from the hole's edge to both edges of the specimen with a calliper or a travelling microscope; or remount the specimen turned end for end: the offset changes sides. Along the load it is hardly observable."
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let [d1, d2] = setup.vector([amplitude[0], amplitude[1]]);
        setup.morph.hole_offset[0] += d1;
        setup.morph.hole_offset[1] += d2;
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        unless_offered(scene, Change::HoleOffset)
    }
}
