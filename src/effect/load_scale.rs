//! The load is not the one that was read.

use super::{Effect, EffectParameter, Entry, Kind};
use crate::fem::Setup;

pub struct LoadScale;

impl Effect for LoadScale {
    fn entry(&self) -> Entry {
        Entry {
            name: "load_scale",
            kind: Kind::Mechanical,
            parameters: const { &[EffectParameter::new("percent", 0.5, 99.0)] },
            about: "The true load differs from the declared one by this percentage. All moduli scaled together do exactly the same to the field.",
            confirm: "Calibrate the load cell against dead weights or a reference cell; the displacement field cannot tell.",
        }
    }

    fn is_of_every_test(&self) -> bool {
        true
    }

    fn is_force_scale(&self) -> bool {
        true
    }

    fn alter(&self, amplitude: &[f64], setup: &mut Setup) {
        let factor = 1.0 + 0.01 * amplitude[0];
        setup.load = setup.load.times(factor);
    }
}
