//! Which effects are sought.

use crate::effect::{EFFECTS, Effect, Kind, LOAD_SCALE, obstacle};
use crate::infer::Model;

/// Effects that may be weighed in a model, and those that may not, with the reason.
pub fn candidates(model: &Model) -> (Vec<&'static dyn Effect>, Vec<(&'static str, String)>) {
    let scene = model.scene();
    let mut chosen = Vec::new();
    let mut left_out = Vec::new();
    for effect in EFFECTS {
        let name = effect.name();
        if model.effects.iter().any(|e| e.name() == name) {
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
        } else if name == LOAD_SCALE.name() {
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
