//! What tracing rests on: the evidence, and the point about which the test was linearised for it.

use super::evidence::Evidence;
use crate::experiment::series::SeriesState;
use crate::identify::Prepared;
use crate::infer::{EffectUnderLaw, Model};
use crate::linearise::{AtPlaces, AtPoints, Forward, Measured, Observing, Slopes};

/// What was weighed, and about what.
pub struct Traced {
    pub evidence: Evidence,
    pub point: LinearisationPoint,
}

/// The point about which a test was linearised, and what was sought there.
#[derive(Clone)]
pub struct LinearisationPoint {
    /// Constants, thickness, effects that act, border units, with every step's own.
    pub state: SeriesState,
    /// Effects of the model and candidates, each by a law where it has one.
    pub declared: Vec<EffectUnderLaw>,
    pub sought: Vec<EffectUnderLaw>,
}

/// The forward model of what was measured.
pub fn forward<'a>(
    model: &'a Model,
    prepared: &'a Prepared,
    measured: &'a Measured,
    step: &'a (dyn Fn() + Sync),
) -> Forward<'a> {
    let experiment = &*prepared.problem.experiment;
    let (sight, blocks) = (&prepared.observation.sight, &measured.blocks);
    let observing: Box<dyn Observing> = match &prepared.observation.steps {
        Some(steps) => Box::new(AtPlaces::over_blocks(experiment, sight, steps, blocks)),
        None => Box::new(AtPoints {
            experiment,
            slopes: Slopes::new(experiment, sight, blocks),
            size_mm: measured.size_mm,
        }),
    };
    Forward {
        model,
        observing,
        step,
    }
}
