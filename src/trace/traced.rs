//! What tracing rests on: the evidence, and the point about which the test was linearised for it.

use super::evidence::Evidence;
use crate::experiment::series::SeriesState;
use crate::experiment::{FieldSolver, Sight};
use crate::files::{Stored, stored};
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

stored!(LinearisationPoint {
    state,
    declared,
    sought
});

impl Traced {
    /// The bytes of all that a stage is made of which goes on from here.
    pub fn bytes(&self, model: &Model) -> Vec<u8> {
        let mut of = bytes_of(model, &self.evidence.measured);
        self.point.put(&mut of);
        self.evidence.sensitivities.put(&mut of);
        of
    }
}

/// The bytes of a model and of what was measured of it.
pub fn bytes_of(model: &Model, measured: &Measured) -> Vec<u8> {
    let mut of = Vec::new();
    let file = model.file.to_json().unwrap_or_default();
    file.to_string().put(&mut of);
    (model.known.clone(), model.nominal.clone()).put(&mut of);
    measured.averages.put(&mut of);
    of
}

/// The forward model of what was measured.
pub fn forward<'a>(
    model: &'a Model,
    prepared: &'a Prepared,
    measured: &'a Measured,
    step: &'a (dyn Fn() + Sync),
) -> Forward<'a> {
    let test = (&*prepared.problem.experiment, &prepared.observation.sight);
    Forward {
        model,
        observing: over_blocks(test, prepared, measured),
        step,
    }
}

/// How the test that an experiment solves is compared with the measurement: a field by its blocks, a series by the blocks of every step.
/// `sight` is where its points lie.
pub fn over_blocks<'a>(
    (experiment, sight): (&'a dyn FieldSolver, &'a Sight),
    prepared: &'a Prepared,
    measured: &'a Measured,
) -> Box<dyn Observing + 'a> {
    let blocks = &measured.blocks;
    match &prepared.observation.steps {
        Some(steps) => Box::new(AtPlaces::over_blocks(experiment, sight, steps, blocks)),
        None => Box::new(AtPoints {
            experiment,
            slopes: Slopes::new(experiment, sight, blocks),
            size_mm: measured.size_mm,
        }),
    }
}
