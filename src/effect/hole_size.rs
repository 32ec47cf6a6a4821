//! The hole is larger or smaller than nominal.

use super::{Effect, Kind, Parameter, Scene, unless_offered};
use crate::fem::Setup;
use crate::geometry::Change;

pub struct HoleSize;

impl Effect for HoleSize {
    fn name(&self) -> &'static str {
        "hole_size"
    }

    fn parameters(&self) -> &'static [Parameter] {
        const { &[Parameter::new("diameter_percent", 2.0, 90.0)] }
    }

    fn kind(&self) -> Kind {
        Kind::Mechanical
    }

    fn about(&self) -> &'static str {
        "The hole's diameter differs from the nominal one by this percentage of it."
    }

    fn confirm(&self) -> &'static str {
        "Measure the hole's diameter with pin gauges, a calliper or a microscope, along and across the load and on both faces."
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.morph.hole_size *= 1.0 + 0.01 * amplitude[0];
    }

    fn obstacle(&self, scene: &Scene) -> Option<&'static str> {
        unless_offered(scene, Change::HoleSize)
    }
}
