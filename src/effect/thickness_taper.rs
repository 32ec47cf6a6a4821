//! The plate is thicker on one side, or at one end.

use super::{Effect, EffectParameter, Entry, Kind};
use crate::fem::Setup;

pub struct ThicknessTaper;

impl Effect for ThicknessTaper {
    fn entry(&self) -> Entry {
        Entry {
            name: "thickness_taper",
            kind: Kind::Mechanical,
            parameters: const {
                &[
                    EffectParameter::new("across_percent", 2.0, 190.0),
                    EffectParameter::new("along_percent", 2.0, 190.0),
                ]
            },
            about: "The thickness grows by these percentages: from edge to edge along direction 2, and from end to end along direction 1, in the frame of the specimen. Its middle value stays, and so does the uniform end force.",
            confirm: "Measure the thickness with a micrometer at five places at least along each edge. Or remount the specimen turned end for end. For the camera, a taper then changes sides and bending from the grips stays.",
        }
    }

    /// h(t') = h (1 + f t' / W) and h(s') = h (1 + g s' / L), from the plate's middle.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.profile.across += 0.01 * amplitude[0];
        setup.profile.along += 0.01 * amplitude[1];
    }
}
