//! A point of the parameter space of everything that may act, about which a test is linearised.

use crate::effect::{Acting, Effect, amplitude_name};
use crate::identify::Identification;
use crate::infer::Model;

/// A point of the parameter space of everything that may act.
#[derive(Clone)]
pub struct State {
    /// Elastic constants, border units.
    pub constants: Vec<f64>,
    /// Effects with amplitudes other than zero, border units, in the order of the dictionary.
    pub acting: Vec<Acting>,
}

impl State {
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

    /// Give an effect its amplitudes.
    pub fn set(&mut self, effect: &'static dyn Effect, amplitude: Vec<f64>) {
        self.acting.retain(|a| a.effect.name() != effect.name());
        self.acting.push(Acting { effect, amplitude });
        let place = |name: &str| crate::effect::EFFECTS.iter().position(|e| e.name() == name);
        self.acting.sort_by_key(|a| place(a.effect.name()));
    }

    /// Posterior means of an identification.
    pub fn of(model: &Model, found: &Identification) -> Self {
        let mean = |name: &str| found.moments(name).map(|(mean, _)| mean);
        Self::at(model, &mean)
    }

    /// The values that `mean` gives by name (`E1_GPa`, `load_misalignment.angle_deg`), border units; the prior's mean, or no
    /// amplitude, where it gives none.
    pub fn at(model: &Model, mean: &dyn Fn(&str) -> Option<f64>) -> Self {
        let constants = model
            .constants()
            .iter()
            .zip(model.marginals())
            .map(|(name, prior)| mean(name).unwrap_or(prior.mean))
            .collect();
        let acting = model
            .effects
            .iter()
            .map(|effect| Acting {
                effect: *effect,
                amplitude: effect
                    .parameters()
                    .iter()
                    .map(|p| mean(&amplitude_name(*effect, p)).unwrap_or(0.0))
                    .collect(),
            })
            .collect();
        Self { constants, acting }
    }
}
