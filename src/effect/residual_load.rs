//! The picture that is declared to be without load carries some.

use super::forces::{is_loaded, unless_compared};
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct ResidualLoad;

/// Prior sd over the largest force: what friction in the grips and a test that was stopped early leave.
const SHARE: f64 = 0.05;

impl Effect for ResidualLoad {
    fn entry(&self) -> Entry {
        Entry {
            name: "residual_load",
            kind: Kind::Load,
            parameters: const { &[EffectParameter::new("force_N", 50.0, 1e6)] },
            about: "In steps that are declared to be without load this force still acts. The specimen was not let go, or the machine had not come to rest. If the reference picture was under load, the sign is the other one.",
            confirm: "Open one grip and take the picture again. Or declare the force of this step null, and compare.",
        }
    }

    /// All steps without a declared load alike.
    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        loads.iter().map(|f| f64::from(*f == 0.0)).collect()
    }

    fn force(&self, amplitude: &[f64], scene: &Scene) -> f64 {
        amplitude[0] / scene.setup.load.axial
    }

    fn prior_sd_before_camera(&self, _k: usize, scene: &Scene) -> Option<f64> {
        Some(SHARE * scene.setup.load.axial.abs())
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        let loads = &scene.declared_loads;
        let told = loads.contains(&Some(0.0)) && loads.iter().any(is_loaded);
        unless_compared(scene).or((!told)
            .then_some("no step is declared to be without load beside one under a known one"))
    }
}
