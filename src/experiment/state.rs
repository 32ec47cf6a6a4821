//! A point of the parameter space of everything that may act on an experiment.

use serde::{Deserialize, Serialize};

use crate::effect::{Acting, EFFECTS, Effect};

/// Elastic constants, thickness, and the effects that act.
#[derive(Clone, Serialize, Deserialize)]
pub struct State {
    /// Elastic constants, border units.
    pub constants: Vec<f64>,
    /// Total thickness, mm.
    pub thickness_mm: f64,
    acting: Vec<Acting>,
}

impl State {
    /// A state in which no effect acts.
    pub fn new(constants: &[f64], thickness_mm: f64) -> Self {
        Self {
            constants: constants.to_vec(),
            thickness_mm,
            acting: Vec::new(),
        }
    }

    /// The effects with amplitudes other than zero, border units, in the order of the dictionary.
    pub fn acting(&self) -> &[Acting] {
        &self.acting
    }

    /// Amplitudes of an effect, zeros if it does not act.
    pub fn amplitude(&self, effect: &dyn Effect) -> Vec<f64> {
        self.acting
            .iter()
            .find(|a| a.effect.name() == effect.name())
            .map_or_else(
                || vec![0.0; effect.parameters().len()],
                |a| a.amplitude.clone(),
            )
    }

    /// Give an effect its amplitudes; with zeros it does not act.
    pub fn set(&mut self, effect: &'static dyn Effect, amplitude: Vec<f64>) {
        self.acting.retain(|a| a.effect.name() != effect.name());
        if amplitude.iter().all(|a| *a == 0.0) {
            return;
        }
        self.acting.push(Acting { effect, amplitude });
        let place = |name: &str| EFFECTS.iter().position(|e| e.name() == name);
        self.acting.sort_by_key(|a| place(a.effect.name()));
    }

    /// Change parameter `k` of an effect by some border units.
    pub fn shift(&mut self, effect: &'static dyn Effect, k: usize, by: f64) {
        let mut amplitude = self.amplitude(effect);
        amplitude[k] += by;
        self.set(effect, amplitude);
    }

    /// The same state with effects added.
    #[must_use]
    pub fn with(mut self, acting: impl IntoIterator<Item = Acting>) -> Self {
        for a in acting {
            self.set(a.effect, a.amplitude);
        }
        self
    }
}
