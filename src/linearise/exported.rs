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
        let of = |exported: &InSteps| Self {
            exported: exported.clone(),
        };
        let mut found = of(seen);
        for _ in 1..SOLUTIONS {
            let Some(added) = found.added(at, scene) else {
                break;
            };
            // the motion of every step was found from what is exported, and has what is added to all places alike
            let free = |u: &Vec<[f64; 2]>| rigid_free(places, counts, u);
            found = of(seen);
            add(&mut found.exported, &added.iter().map(free).collect());
        }
        found
    }

    /// What such effects add in a state, with the shifts of their wave; none where none of them acts.
    pub(super) fn added(&self, state: &SeriesState, scene: &Scene) -> Option<InSteps> {
        let acting: Vec<&Acting> = acting(state, scene).collect();
        if acting.is_empty() {
            return None;
        }
        let wave = |u: [f64; 2]| {
            acting.iter().fold([0.0; 2], |sum, a| {
                let unit = a.effect.exported(scene, u).unwrap_or_default();
                [0, 1].map(|c| sum[c] + a.amplitude[0] * unit[c])
            })
        };
        let pixel = scene.pixel_mm.unwrap_or_default();
        let steps = self.exported.iter().enumerate().map(|(step, all)| {
            let shift = state.shifts.get(step).copied().unwrap_or_default();
            let by = scene.frame.vector(shift.map(|s| s * pixel));
            let places = all.iter().map(|u| wave([u[0] + by[0], u[1] + by[1]]));
            places.collect()
        });
        Some(steps.collect())
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
