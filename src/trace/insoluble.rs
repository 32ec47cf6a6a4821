//! Effects that cannot be solved about where a test is linearised: a metal that flows under its load, a hole that meets an edge. They are
//! left out with the reason; one effect of many ends no run.

use rayon::prelude::*;

use super::sensitivities::Linearised;
use crate::effect::Effect;
use crate::error::{Blame, Error, Result};
use crate::experiment::series::SeriesState;
use crate::experiment::{Direction, State, predict_with_gradient};
use crate::infer::{Acts, Stepped};

/// Effects by name, each with the reason why it is left out.
pub type Insoluble = Vec<(&'static str, String)>;

/// Trace with some effects and, where that ends with a fault of the input, again without those that `insoluble` finds, if it finds any.
///
/// # Errors
/// Those of `trace`.
pub fn without_insoluble<E: Clone, T>(
    effects: Vec<E>,
    name: &dyn Fn(&E) -> &'static str,
    insoluble: &dyn Fn(&[E]) -> Result<Insoluble>,
    trace: &dyn Fn(Vec<E>, Insoluble) -> Result<T>,
) -> Result<T> {
    let error = match trace(effects.clone(), Vec::new()) {
        Err(e) if e.blame() == Blame::Input => e,
        done => return done,
    };
    let found = insoluble(&effects)?;
    if found.is_empty() {
        return Err(error);
    }
    let mut left = effects;
    left.retain(|e| found.iter().all(|(n, _)| *n != name(e)));
    trace(left, found)
}

impl Linearised<'_> {
    /// Those of some effects whose sensitivities about a state have no solution.
    ///
    /// # Errors
    /// Those of the state's own solution.
    pub fn insoluble(&self, at: &State, effects: &[&'static dyn Effect]) -> Result<Insoluble> {
        let here = predict_with_gradient(self.experiment, at, self.few.sight())?;
        let anchor = self.experiment.anchor(at)?;
        let about = (at, anchor.as_ref());
        let fault = |effect: &&'static dyn Effect| {
            let mut parameters = 0..effect.parameters().len();
            let error = parameters.find_map(|k| {
                self.column(about, &here, Direction::Amplitude(*effect, k))
                    .err()
            });
            error.map(|e| (effect.name(), reason(&e)))
        };
        Ok(effects.par_iter().filter_map(fault).collect())
    }
}

/// The same of a series.
///
/// # Errors
/// Those of the state's own solution.
pub fn insoluble_in_series(
    stepped: &Stepped<'_>,
    at: &SeriesState,
    effects: &[Acts],
) -> Result<Insoluble> {
    let here = stepped.here(at)?;
    let fault = |acts: &Acts| {
        let error = here.columns(acts).err()?;
        Some((acts.effect.name(), reason(&error)))
    };
    let mut found: Insoluble = effects.par_iter().filter_map(fault).collect();
    found.dedup_by_key(|(name, _)| *name);
    Ok(found)
}

fn reason(error: &Error) -> String {
    format!("it cannot be solved here: {error}")
}
