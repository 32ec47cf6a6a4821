//! A model whose measurement is a load series.

use super::effect_under_law::EffectUnderLaw;
use super::model::Model;
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

    /// A declared effect of a series with its law.
    pub fn under_law(&self, effect: &'static dyn Effect) -> EffectUnderLaw {
        let moves = effect.scope() == Scope::Motion;
        let law = self.experiment().laws.get(effect.name()).copied();
        EffectUnderLaw {
            effect,
            law: moves.then_some(law.unwrap_or(Law::Load)),
        }
    }
}
