//! Which effects are sought.

use crate::effect::{EFFECTS, Effect, Kind, obstacle};
use crate::infer::{EffectUnderLaw, Model};

/// Effects that may be weighed in a model, and those that may not, with the reason.
pub fn candidates(model: &Model) -> (Vec<&'static dyn Effect>, Vec<(&'static str, String)>) {
    let scene = model.scene();
    let mut chosen = Vec::new();
    let mut left_out = Vec::new();
    for effect in EFFECTS {
        let name = effect.name();
        if model.effects.iter().any(|e| e.name() == name) || !effect.concerns(&scene) {
            continue;
        }
        let listed = model
            .experiment()
            .candidates
            .as_ref()
            .is_none_or(|list| list.iter().any(|n| n == name));
        if !listed {
            left_out.push((name, "not among the model's candidates".to_string()));
        } else if let Some(reason) = obstacle(*effect, &scene) {
            left_out.push((name, reason.to_string()));
        } else if effect.needs_declared_scatter() && !model.declares_scatter(*effect) {
            let why = "how much of it specimens have is not declared in plausible";
            left_out.push((name, why.to_string()));
        } else if effect.is_force_scale() {
            left_out.push((
                name,
                "a scale of the load cannot be told from a common factor of all moduli".to_string(),
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

/// Whether two laws of one effect have weights over these steps in common.
pub(super) fn shares(a: &EffectUnderLaw, b: &EffectUnderLaw, loads: &[f64]) -> bool {
    let weights = b.weights(loads);
    a.effect.name() == b.effect.name() && a.weights(loads).iter().any(|w| weights.contains(w))
}
