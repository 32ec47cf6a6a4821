//! A model whose measurement is a load series.

use super::effect_under_law::EffectUnderLaw;
use super::model::Model;
use super::steps::with_the_load;
use crate::effect::{Effect, Scope};
use crate::error::{Error, Result};
use crate::experiment::series::Law;
use crate::field::Series;

impl Model {
    /// Read the load series, if the measurement is one.
    ///
    /// # Errors
    /// Those of [`Series::read`]; no hole where the model has one.
    pub fn read_series(&self) -> Result<Option<Series>> {
        let experiment = self.experiment();
        let Some(steps) = &experiment.steps else {
            return Ok(None);
        };
        let window = experiment.window_mm;
        let series = Series::read(&experiment.measurement, steps, self.base_dir(), window)?;
        self.check_hole(&series.field)?;
        Ok(Some(series))
    }

    /// What knows one load alone refuses a series.
    pub(super) fn refuse_series(&self) -> Result<()> {
        match &self.experiment().steps {
            None => Ok(()),
            Some(steps) => Err(Error::input(
                format!("{}: experiments[0].steps", self.path.display()),
                "one load and one measurement, because this knows no load series",
            )
            .found(format!("{} steps", steps.len()))
            .hint("declare one step's force as load.force_N and its file as measurement.file")),
        }
    }

    /// Sd of the force to which what grows with the load belongs, by the errors that declared forces have each in its own step, percent.
    pub(super) fn own_forces_percent(&self) -> f64 {
        let experiment = self.experiment();
        let steps = experiment.steps.iter().flatten();
        let declared: Vec<f64> = steps.filter_map(|s| s.force_n).collect();
        let loaded = declared.iter().filter(|f| **f != 0.0).count();
        if loaded == 0 {
            return 0.0;
        }
        let weights = with_the_load(&declared);
        let shares = declared.iter().zip(&weights).map(|(f, w)| (f * w).powi(2));
        experiment.forces().sd_percent * shares.sum::<f64>().sqrt()
    }

    /// Declared effects of a series that take part by columns over its steps, beside rigid motion in the plane, which every step has.
    pub fn stepped(&self) -> Vec<EffectUnderLaw> {
        let stepped = self.effects.iter().filter(|e| self.is_stepped(**e));
        let other = stepped.filter(|e| !e.is_rigid());
        other.map(|e| self.under_law(*e)).collect()
    }

    /// A declared effect of a series with its law.
    pub fn under_law(&self, effect: &'static dyn Effect) -> EffectUnderLaw {
        let moves = effect.scope() == Scope::Motion;
        let law = self.experiment().laws.get(effect.name()).copied();
        EffectUnderLaw {
            effect,
            law: moves.then_some(law.unwrap_or(Law::Load)),
        }
    }

    /// Whether an effect acts by steps in this model.
    pub(super) fn is_stepped(&self, effect: &'static dyn Effect) -> bool {
        let several = self
            .experiment()
            .steps
            .as_ref()
            .is_some_and(|s| s.len() > 1);
        several && self.under_law(effect).is_stepped()
    }
}
