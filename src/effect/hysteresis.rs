//! After a larger force the specimen strains more under the same one.

use super::forces::{returned, unless_compared};
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct Hysteresis;

impl Effect for Hysteresis {
    fn entry(&self) -> Entry {
        Entry {
            name: "hysteresis",
            kind: Kind::Load,
            parameters: const { &[EffectParameter::new("percent", 5.0, 50.0)] },
            about: "In steps after a larger force the specimen strains more by this percentage. Causes: damage, friction in the grips, or a load cell that reads otherwise on the way down.",
            confirm: "Load and unload twice, with pictures at the same forces on the way up and on the way down. A second load cell excludes the machine's friction.",
        }
    }

    /// The force of each step that a larger one came before.
    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        let steps = loads.iter().zip(returned(loads));
        steps
            .map(|(f, returned)| if returned { *f } else { 0.0 })
            .collect()
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        let loads: Vec<f64> = scene
            .declared_loads
            .iter()
            .map(|f| f.unwrap_or(0.0))
            .collect();
        let acts = self.over_steps(&loads).iter().any(|f| *f != 0.0);
        unless_compared(scene)
            .or((!acts).then_some("no step under load comes after one under a larger load"))
    }
}
