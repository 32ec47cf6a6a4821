//! Reducing an observation, step by step, to what a model of the specimen can explain.

use super::fields::modes;
use crate::error::Result;
use crate::experiment::{FieldSolver, State};
use crate::infer::{Model, Observation};

/// What an observation is reduced with.
pub struct ReductionInput<'a> {
    pub model: &'a Model,
    pub experiment: &'a dyn FieldSolver,
    /// States spread over the box of the constants, and the one nearest to the prior means.
    pub states: &'a [State],
    pub nominal: State,
}

impl ReductionInput<'_> {
    /// What the constants can make of the points of an observation.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn modes(&self, observation: &Observation) -> Result<Vec<Vec<[f64; 2]>>> {
        modes(self.experiment, self.states, &observation.sight)
    }
}

/// Takes an observation and returns it without what no model of the specimen explains.
pub type Reduction = fn(&ReductionInput<'_>, Observation) -> Result<Observation>;
