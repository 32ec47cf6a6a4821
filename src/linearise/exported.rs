//! What the recording of a series adds by the displacement as it was exported.

use crate::effect::{Acting, Scene};
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
    /// The displacement as it is exported, mm.
    exported: InSteps,
}

impl Waves {
    /// About a state `at` that the camera reports as `seen` but for such effects, at places that count with `counts`.
    pub(super) fn about(
        at: &SeriesState,
        seen: &InSteps,
        scene: &Scene,
        (places, counts): (&[[f64; 2]], &[usize]),
    ) -> Self {
        let of = |exported: InSteps| Self { exported };
        let mut found = of(seen.clone());
        for _ in 1..SOLUTIONS {
            let Some(added) = found.added(at, scene) else {
                break;
            };
            // the motion of every step was found from what is exported, and has what is added to all places alike
            let free = |u: &Vec<[f64; 2]>| rigid_free(places, counts, u);
            found = of(seen.clone());
            add(&mut found.exported, &added.iter().map(free).collect());
        }
        found
    }

    /// What such effects add in a state, with the shifts of their wave; none where none of them acts.
    pub(super) fn added(&self, state: &SeriesState, scene: &Scene) -> Option<InSteps> {
        let mut read = self.exported.clone();
        for (step, shift) in read.iter_mut().zip(&state.shifts) {
            let pixel = scene.pixel_mm.unwrap_or_default();
            let by = scene.frame.vector(shift.map(|s| s * pixel));
            step.iter_mut()
                .for_each(|u| *u = [u[0] + by[0], u[1] + by[1]]);
        }
        let of = |a: &Acting| {
            let wave = |u: &[f64; 2]| a.effect.exported(scene, *u);
            let in_step = |step: &Vec<[f64; 2]>| {
                let waves = step.iter().filter_map(wave);
                waves.map(|u| u.map(|u| a.amplitude[0] * u)).collect()
            };
            read.iter().map(in_step).collect()
        };
        let all = acting(state, scene).map(of);
        all.reduce(|mut sum: InSteps, own| {
            add(&mut sum, &own);
            sum
        })
    }
}

/// Effects of a state that act through the exported displacement.
pub(super) fn acting<'a>(
    state: &'a SeriesState,
    scene: &'a Scene,
) -> impl Iterator<Item = &'a Acting> {
    let acting = state.shared.acting().iter();
    acting.filter(|a| a.effect.exported(scene, [0.0; 2]).is_some())
}

/// A state without the effects that act through the exported displacement.
pub(super) fn without(state: &SeriesState, scene: &Scene) -> SeriesState {
    let mut without = state.clone();
    for a in acting(state, scene) {
        without.shared.set(a.effect, vec![0.0; a.amplitude.len()]);
    }
    without
}

/// Add fields of every step to others.
pub(super) fn add(sum: &mut InSteps, added: &InSteps) {
    for (sum, added) in sum.iter_mut().flatten().zip(added.iter().flatten()) {
        *sum = [sum[0] + added[0], sum[1] + added[1]];
    }
}
