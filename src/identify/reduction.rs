//! Reducing an observation, step by step, to what a model of the specimen can explain.

use crate::error::Result;
use crate::experiment::FieldSolver;
use crate::infer::{Model, Observation};
use crate::reduce::ReducedModel;

/// What an observation is reduced with.
pub struct With<'a> {
    pub model: &'a Model,
    pub reduced: &'a ReducedModel,
    pub experiment: &'a dyn FieldSolver,
    /// The point of the reduced model's parameters nearest to the prior means.
    pub nominal: Vec<f64>,
}

/// Takes an observation and returns it without what no model of the specimen explains.
pub type Reduction = fn(&With<'_>, Observation) -> Result<Observation>;
