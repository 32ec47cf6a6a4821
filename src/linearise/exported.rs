//! What the recording of a series adds by the displacement as it was exported.

use crate::effect::{EFFECTS, Effect, Scene};
use crate::experiment::series::{SeriesState, rigid_free};

/// What is seen or added in each step at every place, mm.
pub(super) type InSteps = Vec<Vec<[f64; 2]>>;

/// Solutions for the displacement that is exported with what it adds to itself: each leaves a tenth of the error before.
const SOLUTIONS: usize = 3;

/// Fields of effects that act through the exported displacement, about a state. What is exported there is held: of a wave with every pixel no
/// constant, gain or motion may act through its argument, because with it there gains of half a percent were found as hundredths with an sd of
/// a hundredth (prototype study). It is the displacement of the state and not the measured one, whose noise would be its own cause: smooth
/// noise of a hundredth of a pixel was called a wave.
pub(super) struct Waves {
    /// Of every such effect what an amplitude of 1 adds.
    units: Vec<(&'static dyn Effect, InSteps)>,
}

impl Waves {
    /// About a state `at` that the camera reports as `seen` but for such effects, at places that count with `counts`.
    pub(super) fn about(
        at: &SeriesState,
        seen: &InSteps,
        scene: &Scene,
        (places, counts): (&[[f64; 2]], &[usize]),
    ) -> Self {
        let effects = EFFECTS.iter().filter(|e| is_exported(**e, scene));
        let effects: Vec<&'static dyn Effect> = effects.copied().collect();
        let of = |exported: &InSteps| Self {
            units: effects
                .iter()
                .map(|e| (*e, waves(*e, scene, exported)))
                .collect(),
        };
        let mut found = of(seen);
        for _ in 1..SOLUTIONS {
            let Some(added) = found.added(at) else {
                break;
            };
            // the motion of every step was found from what is exported, and has what is added to all places alike
            let free = |u: &Vec<[f64; 2]>| rigid_free(places, counts, u);
            let mut exported = seen.clone();
            add(&mut exported, &added.iter().map(free).collect());
            found = of(&exported);
        }
        found
    }

    /// What such effects add in a state; none where none of them acts.
    pub(super) fn added(&self, state: &SeriesState) -> Option<InSteps> {
        let mut sum: Option<InSteps> = None;
        for (effect, unit) in &self.units {
            let amplitude = state.shared.amplitude(*effect)[0];
            if amplitude == 0.0 {
                continue;
            }
            let scaled = |step: &Vec<[f64; 2]>| {
                let places = step.iter().map(|u| u.map(|u| amplitude * u));
                places.collect::<Vec<_>>()
            };
            let own: InSteps = unit.iter().map(scaled).collect();
            match &mut sum {
                None => sum = Some(own),
                Some(sum) => add(sum, &own),
            }
        }
        sum
    }
}

/// A state without the effects that act through the exported displacement.
pub(super) fn without(state: &SeriesState, scene: &Scene) -> SeriesState {
    let mut without = state.clone();
    for a in state.shared.acting() {
        if is_exported(a.effect, scene) {
            without.shared.set(a.effect, vec![0.0; a.amplitude.len()]);
        }
    }
    without
}

fn is_exported(effect: &dyn Effect, scene: &Scene) -> bool {
    effect.exported(scene, [0.0; 2]).is_some()
}

fn waves(effect: &dyn Effect, scene: &Scene, exported: &InSteps) -> InSteps {
    let in_step = |step: &Vec<[f64; 2]>| {
        let wave = step.iter().filter_map(|u| effect.exported(scene, *u));
        wave.collect()
    };
    exported.iter().map(in_step).collect()
}

/// Add fields of every step to others.
pub(super) fn add(sum: &mut InSteps, added: &InSteps) {
    for (sum, added) in sum.iter_mut().flatten().zip(added.iter().flatten()) {
        *sum = [sum[0] + added[0], sum[1] + added[1]];
    }
}
