//! The force of one step is another than the declared one, beyond the machine's class.

use super::forces::{is_loaded, unless_compared};
use super::{Effect, EffectParameter, Entry, Kind, Scene};

/// Of the `0`-th step, counted from 0. Every step is an effect of its own: forces are wrong in few steps and then by much, which one
/// normal prior for all would spread over all.
pub struct StepForce(pub usize);

const NAMES: [&str; 12] = [
    "step_force_1",
    "step_force_2",
    "step_force_3",
    "step_force_4",
    "step_force_5",
    "step_force_6",
    "step_force_7",
    "step_force_8",
    "step_force_9",
    "step_force_10",
    "step_force_11",
    "step_force_12",
];

impl Effect for StepForce {
    fn entry(&self) -> Entry {
        Entry {
            name: NAMES[self.0],
            kind: Kind::Load,
            parameters: const { &[EffectParameter::new("percent", 5.0, 50.0)] },
            about: "In the step of this number the true force is larger than the declared one by this percentage. Steps count from 1, in the order of the pictures. Causes: the picture was taken late, while the force fell, or the wrong line of the machine's file was read.",
            confirm: "Look up force and time of this picture in the machine's record. Or hold the force, take three pictures, and declare their mean; with `null` in place of the force, the other steps say what it was.",
        }
    }

    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        let steps = loads.iter().enumerate();
        steps
            .map(|(s, f)| if s == self.0 { *f } else { 0.0 })
            .collect()
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        let loads = &scene.declared_loads;
        if !loads.get(self.0).is_some_and(is_loaded) {
            return Some("no step of this number has a declared force");
        }
        let several = loads.iter().filter(|f| is_loaded(f)).count() > 1;
        unless_compared(scene).or((!several).then_some("no other step is under a declared force"))
    }
}
