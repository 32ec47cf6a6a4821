//! What the recording of a series adds by the displacement as it was exported.

use std::sync::OnceLock;

use super::slopes::averages;
use crate::effect::{EFFECTS, Effect, Scene};
use crate::experiment::series::SeriesState;
use crate::field::Blocks;
use crate::infer::Steps;

/// What is added in each step at every place, mm.
type InSteps = Vec<Vec<[f64; 2]>>;

/// Fields of effects that act through the measured displacement itself. Of a wave with every pixel no constant and no gain may act through its
/// argument: with the model's displacement there, gains of half a percent were found as hundredths with an sd of a hundredth (prototype study).
pub struct AsExported<'a> {
    steps: &'a Steps,
    /// Averages over these, or the points themselves.
    blocks: Option<&'a Blocks>,
    /// Of every such effect what an amplitude of 1 adds, once one of them acts.
    units: OnceLock<Vec<(&'static dyn Effect, InSteps)>>,
}

impl<'a> AsExported<'a> {
    pub fn new(steps: &'a Steps, blocks: Option<&'a Blocks>) -> Self {
        Self {
            steps,
            blocks,
            units: OnceLock::new(),
        }
    }

    /// The state without such effects, and what they add to it; none where none of them acts.
    pub(super) fn split(
        &self,
        state: &SeriesState,
        scene: &Scene,
    ) -> Option<(SeriesState, InSteps)> {
        let acting = state.shared.acting().iter();
        let own: Vec<_> = acting.filter(|a| is_exported(a.effect, scene)).collect();
        let mut added: Option<InSteps> = None;
        let mut without = state.clone();
        for a in own {
            without.shared.set(a.effect, vec![0.0; a.amplitude.len()]);
            let (_, unit) = self
                .units(scene)
                .iter()
                .find(|(effect, _)| effect.name() == a.effect.name())?;
            let of = unit.iter().map(|step| {
                let scaled = step.iter().map(|u| u.map(|u| a.amplitude[0] * u));
                scaled.collect::<Vec<_>>()
            });
            match &mut added {
                None => added = Some(of.collect()),
                Some(sum) => add(sum, of.collect()),
            }
        }
        added.map(|added| (without, added))
    }

    /// Threads that ask at once each find them: one that waited could hold up the other's parallel loops.
    fn units(&self, scene: &Scene) -> &[(&'static dyn Effect, InSteps)] {
        if let Some(units) = self.units.get() {
            return units;
        }
        let own = EFFECTS.iter().filter(|e| is_exported(**e, scene));
        let of = |effect: &&'static dyn Effect| {
            let in_step = |u: &Vec<[f64; 2]>| {
                let wave = u.iter().filter_map(|u| effect.exported(scene, *u));
                self.average(wave.collect())
            };
            (
                *effect,
                self.steps.displacement.iter().map(in_step).collect(),
            )
        };
        let found = own.map(of).collect();
        self.units.get_or_init(|| found)
    }

    fn average(&self, field: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        let Some(blocks) = self.blocks else {
            return field;
        };
        let [first, second] = averages(blocks, &field);
        first.iter().zip(&second).map(|(a, b)| [*a, *b]).collect()
    }
}

fn is_exported(effect: &dyn Effect, scene: &Scene) -> bool {
    effect.exported(scene, [0.0; 2]).is_some()
}

/// Add fields of every step to others.
pub(super) fn add(sum: &mut InSteps, added: InSteps) {
    for (sum, added) in sum.iter_mut().flatten().zip(added.into_iter().flatten()) {
        *sum = [sum[0] + added[0], sum[1] + added[1]];
    }
}
