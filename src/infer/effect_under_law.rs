//! Effects as they act in a load series.

use serde::{Deserialize, Serialize};

use crate::effect::{Effect, EffectParameter, Scope};
use crate::experiment::series::Law;
use crate::parameter::Parameter;

/// An effect of a series with the law of its amplitude, where it has one.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct EffectUnderLaw {
    pub effect: &'static dyn Effect,
    pub law: Option<Law>,
}

impl EffectUnderLaw {
    /// All that may act of some effects: motions by every law but the free one, which is offered where one of these acts.
    pub fn all(effects: &[&'static dyn Effect]) -> Vec<Self> {
        let laws = [Law::Constant, Law::Load, Law::Seated, Law::Kept, Law::Drift];
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

    /// Some effects of a single field.
    pub fn without_laws(effects: &[&'static dyn Effect]) -> Vec<Self> {
        let one = |&effect| Self { effect, law: None };
        effects.iter().map(one).collect()
    }

    /// The same with an amplitude of its own in every step, of an effect that moves the specimen.
    pub fn freed(&self) -> Option<Self> {
        self.law.filter(|law| *law != Law::Free)?;
        Some(Self {
            law: Some(Law::Free),
            ..*self
        })
    }

    /// Whether another is the same effect by the same law.
    pub fn is(&self, other: &Self) -> bool {
        self.effect.name() == other.effect.name() && self.law == other.law
    }

    /// Whether its amplitude has a share of its own in each step.
    pub fn varies(&self) -> bool {
        self.law.is_some() || self.effect.scope() == Scope::Force
    }

    /// Its amplitude in each step over the one that is stated; of a free one, one set for each step. Without a law all steps share one
    /// amplitude, and its weights are none.
    pub fn weights(&self, loads: &[f64]) -> Vec<Vec<f64>> {
        if self.effect.scope() == Scope::Force {
            return vec![self.effect.over_steps(loads)];
        }
        self.law
            .map_or_else(|| vec![Vec::new()], |law| law.weights(loads))
    }

    /// Its amplitudes over steps of some `names`: for every set of weights all parameters.
    pub fn amplitudes(&self, loads: &[f64], names: &[String]) -> Vec<Amplitude> {
        let free = self.law == Some(Law::Free);
        let sets = self.weights(loads).into_iter().enumerate();
        let of = |(s, weights): (usize, Vec<f64>)| {
            let parameters = self.effect.parameters().iter().enumerate();
            let one = move |(k, parameter): (usize, &EffectParameter)| {
                let of_all = Parameter::amplitude(self.effect.name(), parameter.name);
                let named = match free {
                    true => of_all.in_step(&names[s]),
                    false => of_all,
                };
                Amplitude {
                    name: named.name(),
                    parameter: k,
                    weights: weights.clone(),
                }
            };
            parameters.map(one).collect::<Vec<_>>()
        };
        sets.flat_map(of).collect()
    }
}

/// One amplitude of an effect in a series.
pub struct Amplitude {
    /// `effect.parameter`, and the step's name where it is one step's own.
    pub name: String,
    /// Which of the effect's parameters it is.
    pub parameter: usize,
    /// Its share in each step, where it has a law.
    pub weights: Vec<f64>,
}
