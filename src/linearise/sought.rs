//! Which effects are sought.

use crate::effect::{Companions, EFFECTS, Effect, Kind, why_not};
use crate::experiment::series::{Law, SeriesState};
use crate::infer::{EffectUnderLaw, Model};

/// Effects that may be weighed in a model, and those that may not, with the reason.
pub fn candidates(model: &Model) -> (Vec<&'static dyn Effect>, Vec<(&'static str, String)>) {
    let scene = model.scene();
    let mut chosen = Vec::new();
    let mut left_out = Vec::new();
    for effect in EFFECTS {
        let name = effect.name();
        if model.effects.iter().any(|e| e.name() == name) || !effect.applies_to(&scene) {
            continue;
        }
        let listed = model
            .experiment()
            .candidates
            .as_ref()
            .is_none_or(|list| list.iter().any(|n| n == name));
        if !listed {
            left_out.push((name, "not among the model's candidates".to_string()));
        } else if let Some(reason) = why_not(*effect, &scene) {
            left_out.push((name, reason.to_string()));
        } else if effect.needs_declared_scatter() && !model.always_acts(*effect) {
            let why = "how much of it specimens have is not declared in plausible";
            left_out.push((name, why.to_string()));
        } else if effect.is_of_every_test() {
            left_out.push((
                name,
                "a field hardly tells it from a common factor of all moduli: it acts with its prior"
                    .to_string(),
            ));
        } else if effect.kind() != Kind::Recorded {
            chosen.push(*effect);
        }
    }
    (chosen, left_out)
}

/// How effects may act in a series of some loads: motions by the first of all laws that are the same over these steps, for where the load
/// only grows, what is in proportion to it and what stays are one column, and both would lay claim to one amplitude of the state.
pub fn acting_in(effects: &[&'static dyn Effect], loads: &[f64]) -> Vec<EffectUnderLaw> {
    let mut kept: Vec<EffectUnderLaw> = Vec::new();
    // every step has its own motion in the plane
    let mut all = EffectUnderLaw::all(effects);
    all.retain(|acts| !acts.effect.is_rigid());
    for acts in all {
        if !kept.iter().any(|other| shares(other, &acts, loads)) {
            kept.push(acts);
        }
    }
    kept
}

/// Whether a motion towards the camera is how far the axis of a rotation lies off the hole, where that rotation acts in the state `at`: by the
/// rotation's own law both are one motion, whose axis has a column. `prior_sd` is the motion's own, mm.
pub fn is_of_a_rotation(
    acts: &EffectUnderLaw,
    declared: &[EffectUnderLaw],
    at: &SeriesState,
    prior_sd: f64,
) -> bool {
    let lifts = |other: &EffectUnderLaw| lift_of(other.effect) == Some(acts.effect.name());
    let weights = acts.weights(&at.loads);
    declared.iter().filter(|d| lifts(d)).any(|rotation| {
        let sets = rotation.weights(&at.loads);
        let same = rotation.law == Some(Law::Free) || sets.iter().any(|w| weights.contains(w));
        let mrad = |w: &Vec<f64>| {
            let amplitude = at.amplitude(rotation.effect, w);
            amplitude.iter().fold(0.0, |m: f64, a| m.hypot(*a))
        };
        let largest = sets.iter().map(mrad).fold(0.0, f64::max);
        same && 1e-3 * largest * FARTHEST_AXIS_MM > prior_sd
    })
}

/// What a rotation about an axis off the hole lifts the specimen by, by name.
pub fn lift_of(effect: &dyn Effect) -> Option<&'static str> {
    match effect.companions() {
        Companions::AxisAndPivot { lift } => Some(lift.name()),
        _ => None,
    }
}

/// An axis farther off than this is a motion of its own, mm (prototype study: up to 100 mm it is known to 0.001 mm of the motion inside the
/// rotation, and can never be named apart).
const FARTHEST_AXIS_MM: f64 = 100.0;

/// Whether two laws of one effect have weights over these steps in common.
pub fn shares(a: &EffectUnderLaw, b: &EffectUnderLaw, loads: &[f64]) -> bool {
    let weights = b.weights(loads);
    a.effect.name() == b.effect.name() && a.weights(loads).iter().any(|w| weights.contains(w))
}
