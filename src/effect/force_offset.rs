//! The machine's zero is off.

use super::forces::unless_different;
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct ForceOffset;

/// Prior sd over the largest force: a tare or a preload of some percent is forgotten now and then; a class 1 machine's own zero is
/// within 0.1 % (ISO 7500-1).
const SHARE: f64 = 0.02;

impl Effect for ForceOffset {
    fn entry(&self) -> Entry {
        Entry {
            name: "force_offset",
            kind: Kind::Load,
            parameters: const { &[EffectParameter::new("force_N", 20.0, 1e6)] },
            about: "In every loaded step the true force is the declared one plus this. Causes: the machine's zero is off, or a preload or the weight of a grip was not counted.",
            confirm: "Read the machine's force with the specimen free of the grips, before the test and after it; hang a known weight on the load cell.",
        }
    }

    /// All loaded steps alike.
    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        loads.iter().map(|f| f64::from(*f != 0.0)).collect()
    }

    fn force(&self, amplitude: &[f64], scene: &Scene) -> f64 {
        amplitude[0] / scene.setup.load.axial
    }

    fn prior_sd_before_camera(&self, _k: usize, scene: &Scene) -> Option<f64> {
        Some(SHARE * scene.setup.load.axial.abs())
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_different(scene)
    }
}
