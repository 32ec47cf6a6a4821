//! The forward model of what was measured.

use super::prepared::Prepared;
use crate::experiment::{FieldSolver, PointSet};
use crate::infer::Model;
use crate::linearise::{AtPlaces, AtPoints, Forward, Measured, Observing, Slopes};

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
        solves_width: true,
        step,
    }
}

/// How the test that an experiment solves is compared with the measurement: a field by its blocks, a series by the blocks of every step.
/// `sight` is where its points lie.
pub fn over_blocks<'a>(
    (experiment, sight): (&'a dyn FieldSolver, &'a PointSet),
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
