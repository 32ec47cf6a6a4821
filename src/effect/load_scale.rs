//! The load is not the one that was read.

use super::{Effect, Kind, Parameter};
use crate::fem::Setup;

pub struct LoadScale;

impl Effect for LoadScale {
    fn name(&self) -> &'static str {
        "load_scale"
    }

    fn parameters(&self) -> &'static [Parameter] {
        const { &[Parameter::new("percent", 0.5, 99.0)] }
    }

    fn kind(&self) -> Kind {
        Kind::Mechanical
    }

    fn about(&self) -> &'static str {
        "The true load differs from the declared one by this percentage. All moduli scaled together do exactly the same to the field."
    }

    fn confirm(&self) -> &'static str {
        "Calibrate the load cell against dead weights or a reference cell; the displacement field cannot tell."
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let factor = 1.0 + 0.01 * amplitude[0];
        setup.load.axial *= factor;
        setup.load.shear *= factor;
        setup.load.moment *= factor;
    }
}
