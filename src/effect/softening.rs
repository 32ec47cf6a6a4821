//! The moduli fall with the load.

use super::forces::unless_different;
use super::{Effect, EffectParameter, Entry, Kind, Scene};
use crate::quantity::significant;

pub struct SofteningWithLoad;

impl Effect for SofteningWithLoad {
    fn entry(&self) -> Entry {
        Entry {
            name: "softening",
            kind: Kind::Load,
            parameters: const { &[EffectParameter::new("percent", 2.0, 50.0)] },
            about: "Strains grow faster than the force. Under the largest force, all strains are larger by this percentage than the initial moduli make them; under half the force, by half of it. One factor for all moduli.",
            confirm: "Put a strain gauge or an extensometer far from the hole, and record force and strain without stopping. A bent line shows softening; an error of a single force does not make one. A calibrated second load cell excludes the machine.",
        }
    }

    /// The force times itself.
    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        loads.iter().map(|f| f * f.abs()).collect()
    }

    fn meaning(&self, amplitude: &[[f64; 2]], _scene: &Scene) -> Option<String> {
        let [percent, _] = *amplitude.first()?;
        let secant = 100.0 * (1.0 - 1.0 / (1.0 + 0.01 * percent));
        let lower = if secant > 0.0 { "lower" } else { "higher" };
        let secant = significant(secant.abs(), 0.1 * secant.abs());
        Some(format!(
            "The moduli are the initial ones, of an unloaded specimen; the secant moduli at the largest load are {secant} % {lower}"
        ))
    }

    /// Every specimen creeps a little, and pictures do not show 4 % of it surely. Left out, strains that were 0.8 to 4 % too large were taken for
    /// a `residual_load`, and E came out 3.6 sds too low.
    fn always_acts(&self) -> bool {
        true
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_different(scene)
    }
}
