//! A model whose mechanics another program solves.

use std::sync::Arc;

use super::design_box::dimensions;
use super::model::Model;
use crate::error::Result;
use crate::experiment::FieldSolver;
use crate::reduce::{Dimension, SnapshotExperiment, is_solved_for, ranges};

/// The box of what another program is to solve for: the constants, and the thickness where it is uncertain.
///
/// # Errors
/// Of the input: bounds for a parameter that is none.
pub fn box_to_solve(model: &Model) -> Result<Vec<Dimension>> {
    let mut sides = dimensions(model)?;
    sides.retain(|d| is_solved_for(model.constants(), d));
    Ok(sides)
}

/// An experiment, with the fields of another program where the model names them.
pub(super) fn with_snapshots(
    model: &Model,
    own: Arc<dyn FieldSolver>,
) -> Result<Arc<dyn FieldSolver>> {
    let reduced = &model.file.reduced_model;
    let Some(spec) = reduced.supplied() else {
        return Ok(own);
    };
    let sides = box_to_solve(model)?;
    let names: Vec<&str> = sides.iter().map(|d| &*d.name).collect();
    let supplied = spec.read(model.base_dir(), &names)?;
    let of_mesh = || model.experiment().mesh_origin_mm();
    let origin_mm = spec.origin_mm.or_else(of_mesh).unwrap_or([0.0; 2]);
    let experiment = SnapshotExperiment::new(own, &supplied, origin_mm, reduced.degree)?;
    Ok(Arc::new(experiment))
}

/// The box of an experiment's reduced model: [`box_to_solve`] is that of the rows where another program solved them.
pub(super) fn dimensions_of(model: &Model, experiment: &dyn FieldSolver) -> Result<Vec<Dimension>> {
    let mut sides = dimensions(model)?;
    let Some(given) = experiment.given() else {
        return Ok(sides);
    };
    let solved = box_to_solve(model)?;
    let names: Vec<&str> = solved.iter().map(|d| &*d.name).collect();
    for own in ranges(&names, given.rows) {
        for side in sides.iter_mut().filter(|d| d.name == own.name) {
            *side = own.clone();
        }
    }
    Ok(sides)
}
