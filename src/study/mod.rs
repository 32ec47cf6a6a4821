//! Studies: experiments on one material, of any number and mixture. A kind of experiment is one file and one line of [`EXPERIMENTS`]; the
//! posterior adds the log likelihoods of all experiments over the constants that they share.

mod close;
mod field;
mod file;
pub mod frequencies;
mod linear;
mod section;
mod together;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;

pub use close::{ClosedStudy, StudyStage, close};
pub use field::MeasuredField;
pub use file::Study;
pub use section::{ExperimentSection, SectionMap, undeclared_table};
pub use together::{
    Alone, Disagreement, Exact, PairTension, SampledStudy, alone, identified,
    likelihood_beyond_prior, others, sampled, sections, tensions,
};

use crate::chain::Draws;
use crate::error::{Error, Result};
use crate::identify::{Identification, Options};
use crate::infer::{ConstantsLikelihood, ExperimentEntry, Marginal, Member, Model, ModelOutline};
use crate::laminate::Material;
use crate::progress::Progress;
use crate::trace::Information;

/// A kind of experiment.
pub struct ExperimentReader {
    /// As `kind` has it in a model file.
    pub name: &'static str,
    /// Reads an entry of the model file at a path.
    pub read: fn(&ModelOutline, &ExperimentEntry, &Path) -> Result<Arc<dyn Experiment>>,
}

/// All kinds.
pub static EXPERIMENTS: &[ExperimentReader] = &[
    field::FIELD,
    field::MOCK,
    frequencies::FREQUENCIES,
    linear::LINEAR,
];

/// What all experiments of a study share.
#[derive(Debug)]
pub struct SharedConstants {
    pub material: Material,
    /// Names and priors of the elastic constants.
    pub constants: Vec<(String, Marginal)>,
}

/// How a field that is only planned would be measured.
#[derive(Debug, Clone, Copy)]
pub struct Measuring {
    /// Noise sd of a point, nm.
    pub noise_nm: f64,
    /// Points along each side of the window, a square about the hole.
    pub grid: usize,
}

/// An experiment as a model file declares it.
pub trait Experiment: Send + Sync {
    fn name(&self) -> &str;

    /// The entry of the model file; `absolute` if its paths are to be readable from anywhere.
    ///
    /// # Errors
    /// Of the program: a value that JSON cannot hold. Of the input: a current directory that is gone.
    fn json(&self, absolute: bool) -> Result<Value>;

    /// Files that it reads; they are not read here.
    ///
    /// # Errors
    /// Of the input: a pattern of files that fits none.
    fn files(&self) -> Result<Vec<PathBuf>> {
        Ok(Vec::new())
    }

    /// What it would say of the constants before it is measured.
    ///
    /// # Errors
    /// The input's fault: a specimen that cannot be computed.
    fn information(&self, shared: &SharedConstants, measuring: Measuring) -> Result<Information>;

    /// The same experiment with simulated measurements that stand in the model file itself.
    ///
    /// # Errors
    /// The input's fault: constants that cannot be.
    fn simulate(
        &self,
        shared: &SharedConstants,
        constants: &[f64],
        seed: u64,
    ) -> Result<Arc<dyn Experiment>>;

    /// What was observed, ready to be weighed.
    ///
    /// # Errors
    /// The input's fault: measurements that cannot be of this experiment.
    fn observed(
        &self,
        shared: &SharedConstants,
        options: &Options<'_>,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Observed>>;

    /// The same experiment with an effect declared; none where it cannot declare that.
    fn with_effect(&self, _effect: &str) -> Option<Arc<dyn Experiment>> {
        None
    }

    /// Whose the specimen and the load cell are, in words that are equal where they are one.
    fn owners(&self) -> Vec<String> {
        Vec::new()
    }

    /// The field and its model, which effects of the dictionary are traced in.
    fn field(&self) -> Option<&Model> {
        None
    }
}

/// What a model file says, as JSON.
fn json(value: &impl Serialize) -> Result<Value> {
    serde_json::to_value(value)
        .map_err(|e| Error::program("model.json", "a model that JSON can hold").found(e))
}

/// What was observed in an experiment: its likelihood, and what its part of a posterior means.
pub trait Observed: Send + Sync {
    /// Its parameters (the constants first), its log likelihood with the priors of what is its own, and where to start.
    fn member(&self, shared: &SharedConstants) -> Member;

    /// What its part of a posterior's draws says.
    ///
    /// # Errors
    /// Of the program: draws at which nothing can be predicted.
    fn section(&self, draws: &Draws) -> Result<ExperimentSection>;

    /// Logarithm of the exact likelihood over that of [`Observed::member`] at a point of its parameters.
    fn correction(&self, _point: &[f64]) -> f64 {
        0.0
    }

    /// What may act in it that nobody declared, about the mean of its parameters; `others` is what all other experiments say of the constants.
    fn undeclared(&self, _mean: &[f64], _others: Option<&ConstantsLikelihood>) -> Vec<Undeclared> {
        Vec::new()
    }

    /// The draws of its own posterior, where it was sampled on the way.
    fn draws(&self) -> Option<&Draws> {
        None
    }

    /// The identification of a field.
    fn into_field(self: Box<Self>) -> Option<Identification> {
        None
    }
}

/// An effect that nobody declared, with what the data say of it.
#[derive(Debug, Serialize)]
pub struct Undeclared {
    pub name: &'static str,
    pub parameter: &'static str,
    /// Prior sd, in the parameter's unit.
    pub plausible: f64,
    /// Log Bayes factor for its acting.
    pub log_bayes_factor: f64,
    /// Its amplitude if it acts, and half of what the interval of 68 % spans; in the parameter's unit.
    pub amplitude: [f64; 2],
    /// What it does to each constant at its plausible size, undeclared, in prior sds.
    #[serde(rename = "shift_in_prior_sd")]
    pub shift_sds: Vec<f64>,
    pub confirm: &'static str,
}

/// Log Bayes factor from which an undeclared effect is worth a word.
pub const WORTH: f64 = 3.0;
