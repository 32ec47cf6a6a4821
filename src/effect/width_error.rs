//! The plate is wider or narrower than declared.

use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::fem::Setup;

pub struct WidthError;

impl Effect for WidthError {
    fn entry(&self) -> Entry {
        Entry {
            name: "width_error",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("percent", 0.2, 50.0)] },
            about: "The plate is wider than declared by this percentage. All displacements are smaller, as by larger moduli: beside a hole by 1.3 to 1.4 times the percentage.",
            confirm: "Measure the width with a calliper at several places along the specimen; the displacement field can hardly tell.",
        }
    }

    /// A hundredth of the width is 1.3 % of all moduli, and leaves nanometres.
    fn is_of_every_test(&self) -> bool {
        true
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.morph.width *= 1.0 + 0.01 * amplitude[0];
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        let text = "the mesh has the specimen's width";
        (!scene.setup.geometry.has_parallel_sides()).then_some(text)
    }
}
