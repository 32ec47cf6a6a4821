//! Effects as they act in a load series.

use crate::effect::{Effect, Scope};
use crate::experiment::series::Law;

/// An effect of a series with the law of its amplitude, where it has one.
#[derive(Clone, Copy)]
pub struct Acts {
    pub effect: &'static dyn Effect,
    pub law: Option<Law>,
}

impl Acts {
    /// All that may act of some effects: motions by every law but the free one, which any other is a case of.
    pub fn all(effects: &[&'static dyn Effect]) -> Vec<Self> {
        let laws = [Law::Constant, Law::Load, Law::Seated, Law::Drift];
        let mut all = Vec::new();
        for &effect in effects {
            if effect.scope() == Scope::Motion {
                all.extend(laws.map(|law| Self {
                    effect,
                    law: Some(law),
                }));
            } else {
                all.push(Self { effect, law: None });
            }
        }
        all
    }

    /// Whether the steps of a series tell the effect apart from what the load does.
    pub fn is_stepped(&self) -> bool {
        matches!(self.effect.scope(), Scope::Motion | Scope::Picture)
    }

    /// Its amplitude in each step over the one that is stated.
    pub fn weights(&self, loads: &[f64]) -> Vec<f64> {
        let law = self.law.unwrap_or(Law::Constant);
        law.weights(loads).swap_remove(0)
    }
}
