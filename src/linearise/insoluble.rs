//! Effects that cannot be solved about where a test is linearised: a metal that flows under its load, a hole that meets an edge. They are
//! left out with the reason; one effect of many ends no run.

use rayon::prelude::*;

use super::forward::Forward;
use crate::error::{Blame, Error, Result};
use crate::experiment::series::SeriesState;
use crate::infer::EffectUnderLaw;

/// Effects by name, each with the reason why it is left out.
pub type Insoluble = Vec<(&'static str, String)>;

/// Trace with some effects and, where that ends with a fault of the input, again without those that `insoluble` finds, if it finds any.
///
/// # Errors
/// Those of `trace`.
pub fn without_insoluble<T>(
    effects: Vec<EffectUnderLaw>,
    insoluble: &dyn Fn(&[EffectUnderLaw]) -> Result<Insoluble>,
    trace: &dyn Fn(Vec<EffectUnderLaw>, Insoluble) -> Result<T>,
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
    left.retain(|e| found.iter().all(|(n, _)| *n != e.effect.name()));
    trace(left, found)
}

/// Those of some effects whose sensitivities about a state have no solution.
///
/// # Errors
/// Those of the state's own solution.
pub fn insoluble(
    forward: &Forward<'_>,
    at: &SeriesState,
    effects: &[EffectUnderLaw],
) -> Result<Insoluble> {
    let here = forward.about(at)?;
    let fault = |effect: &EffectUnderLaw| {
        let error = here.columns(effect).err()?;
        Some((effect.effect.name(), reason(&error)))
    };
    let mut found: Insoluble = effects.par_iter().filter_map(fault).collect();
    found.dedup_by_key(|(name, _)| *name);
    Ok(found)
}

fn reason(error: &Error) -> String {
    format!("it cannot be solved here: {error}")
}
