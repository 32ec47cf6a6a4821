//! The hole was drilled beside its place.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_movable};
use crate::fem::Setup;

pub struct HoleOffset;

impl Effect for HoleOffset {
    fn entry(&self) -> Entry {
        Entry {
            name: "hole_offset",
            kind: Kind::Mechanical,
            parameters: const {
                &[
                    EffectParameter::new("dx_mm", 0.3, 1e3),
                    EffectParameter::new("dy_mm", 0.3, 1e3),
                ]
            },
            about: "The hole lies (dx, dy) along the data's x and y from its nominal place in the plate; the data's origin stays at its centre.",
            confirm: "Measure the distance from the hole's edge to both edges of the specimen with a calliper or a travelling microscope. Or remount the specimen turned end for end: the offset changes sides. Along the load it is hardly observable.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let [d1, d2] = setup.vector([amplitude[0], amplitude[1]]);
        setup.morph.hole_offset[0] += d1;
        setup.morph.hole_offset[1] += d2;
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_movable(scene)
    }
}
