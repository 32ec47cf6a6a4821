//! The hole was drilled beside its place.

use super::{Effect, Kind, Parameter};
use crate::fem::Setup;

pub struct HoleOffset;

impl Effect for HoleOffset {
    fn name(&self) -> &'static str {
        "hole_offset"
    }

    fn parameters(&self) -> &'static [Parameter] {
        const OFFSET: Parameter = Parameter {
            name: "",
            prior_sd: Some(0.3),
            bound: 1e3,
        };
        &[
            Parameter {
                name: "dx_mm",
                ..OFFSET
            },
            Parameter {
                name: "dy_mm",
                ..OFFSET
            },
        ]
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

    /// Seen from the hole, edges and ends move by the opposite.
    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let [d1, d2] = setup.vector([amplitude[0], amplitude[1]]);
        for s in &mut setup.outline.s {
            *s -= d1;
        }
        for t in &mut setup.outline.t {
            *t -= d2;
        }
    }
}
