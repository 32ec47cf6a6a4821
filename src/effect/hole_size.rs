//! The hole is larger or smaller than nominal.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_movable};
use crate::fem::Setup;

pub struct HoleSize;

impl Effect for HoleSize {
    fn entry(&self) -> Entry {
        Entry {
            name: "hole_size",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("diameter_percent", 2.0, 90.0)] },
            about: "The hole's diameter differs from the nominal one by this percentage of it.",
            confirm: "Measure the hole's diameter with pin gauges, a calliper or a microscope, along and across the load and on both faces.",
        }
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.morph.hole_size *= 1.0 + 0.01 * amplitude[0];
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_movable(scene)
    }
}
