//! The line of the load lies beside the plate's centreline.

use super::{Effect, Kind, Parameter};
use crate::fem::Setup;

pub struct InPlaneBending;

impl Effect for InPlaneBending {
    fn name(&self) -> &'static str {
        "in_plane_bending"
    }

    fn parameters(&self) -> &'static [Parameter] {
        &[Parameter {
            name: "eccentricity_mm",
            plausible: Some(0.2),
            bound: 5.0,
        }]
    }

    fn kind(&self) -> Kind {
        Kind::Mechanical
    }

    fn about(&self) -> &'static str {
        "The load acts at a distance from the centreline, positive towards direction 2, so that the plate bends in its plane."
    }

    fn confirm(&self) -> &'static str {
        "Strain gauges on both edges, or turn the specimen over about the loading axis: bending from the grips stays in the frame of the machine, a thickness taper turns with the specimen."
    }

    /// End traction N (1 + 12 e t / W^2): a moment F e.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        setup.load.moment += setup.load.axial * amplitude[0];
    }
}
