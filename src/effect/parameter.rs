//! Parameters of effects: what they are called, what is known of their size, and in which unit.

use super::Effect;
use crate::error::{Error, Result};
use crate::parameter::Parameter;

/// One parameter of an effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectParameter {
    /// Name that ends in its unit (`angle_urad`).
    pub name: &'static str,
    /// Standard deviation of the amplitude's normal prior, in that unit; `None` where nothing bounds it.
    pub prior_sd: Option<f64>,
    /// Largest amplitude for which the effect is modelled.
    pub bound: f64,
    /// Whether nature knows no negative amplitude: the prior is half a normal one.
    pub positive: bool,
}

impl EffectParameter {
    /// With a normal prior of sd `prior_sd` about 0, modelled up to `bound`.
    pub const fn new(name: &'static str, prior_sd: f64, bound: f64) -> Self {
        Self {
            name,
            prior_sd: Some(prior_sd),
            bound,
            positive: false,
        }
    }

    /// The same of an amplitude that cannot be negative.
    pub const fn positive(name: &'static str, prior_sd: f64, bound: f64) -> Self {
        Self {
            positive: true,
            ..Self::new(name, prior_sd, bound)
        }
    }

    /// With nothing known of its size beforehand.
    pub const fn unbounded(name: &'static str, bound: f64) -> Self {
        Self {
            name,
            prior_sd: None,
            bound,
            positive: false,
        }
    }
}

pub(super) fn check_amplitude(place: &str, parameter: &EffectParameter, value: f64) -> Result<()> {
    if value.abs() <= parameter.bound {
        return Ok(());
    }
    let expected = format!("at most {} in size for {}", parameter.bound, parameter.name);
    Err(Error::input(place, expected).found(value))
}

/// `effect.parameter`, the name under which an amplitude is reported.
pub fn amplitude_name(effect: &dyn Effect, parameter: &EffectParameter) -> String {
    Parameter::amplitude(effect.name(), parameter.name).name()
}
