//! What a model is solved by: its experiment over a window, and the problem of its reduced model.

use std::sync::Arc;

use super::model::Model;
use super::supplied::{dimensions_of, with_snapshots};
use crate::effect::Scene;
use crate::error::Result;
use crate::experiment::{
    ExperimentKind, FieldExperiment, FieldSolver, FieldTest, Imaging, MockExperiment,
};
use crate::field::Field;
use crate::field::rigid::{self, RigidMotion};
use crate::reduce::Problem;

/// The experiment of a model seen over a window (low and high corner, (s, t) mm), ready to be predicted, on the model's mesh with
/// its counts of elements multiplied by `finer`.
///
/// # Errors
/// A specimen that cannot be meshed.
pub fn experiment_over(
    model: &Model,
    window: [[f64; 2]; 2],
    finer: f64,
) -> Result<Arc<dyn FieldSolver>> {
    moved_experiment_over(model, window, RigidMotion::NONE, finer)
}

/// The same of a specimen that moves in the plane beside what the load does to it.
///
/// # Errors
/// A specimen that cannot be meshed.
pub fn moved_experiment_over(
    model: &Model,
    window: [[f64; 2]; 2],
    motion: RigidMotion,
    finer: f64,
) -> Result<Arc<dyn FieldSolver>> {
    experiment_on(None, model, (window, motion, finer))
}

/// The same on the mesh of an experiment that is `known`, with what was solved on it, where that is of the same specimen under the same load.
fn experiment_on(
    known: Option<&dyn FieldSolver>,
    model: &Model,
    (window, motion, finer): ([[f64; 2]; 2], RigidMotion, f64),
) -> Result<Arc<dyn FieldSolver>> {
    let [low, high] = window;
    let scene = Scene {
        middle: [0, 1].map(|k| 0.5 * (low[k] + high[k])),
        ..model.scene()
    };
    let spec = model.experiment();
    if spec.kind == ExperimentKind::Mock {
        return Ok(Arc::new(MockExperiment::new(scene, spec.gauge, window)));
    }
    let test = FieldTest {
        specimen: spec.specimen.clone(),
        load: spec.nominal_load(),
        frame: scene.frame,
        gauge: spec.gauge,
        fringe_frequency_per_mm: scene.fringe_frequency_per_mm,
        images: model.subsets().map(|subsets| Imaging {
            subsets,
            camera_distance_mm: scene.camera_distance_mm,
            motion,
        }),
        window,
        density: spec.density().scaled(finer),
        // a simulation asks for one field
        full_order: model.file.reduced_model.full_order || finer > 1.0,
    };
    let plate = known.and_then(|known| known.plate_of(&test));
    let own = match plate {
        Some(plate) => FieldExperiment::on(plate, test, scene)?,
        None => FieldExperiment::new(test, scene)?,
    };
    with_snapshots(model, Arc::new(own))
}

/// The experiment of the model on a mesh of half the density; none where the mesh cannot be that much coarser, or where there is none.
///
/// # Errors
/// A specimen that cannot be meshed.
pub fn coarse_experiment(
    model: &Model,
    fine: &dyn FieldSolver,
) -> Result<Option<Arc<dyn FieldSolver>>> {
    const DENSITY: f64 = 0.5;
    if fine.given().is_some() || fine.mesh_size()[0] == 0 {
        return Ok(None);
    }
    let coarse = moved_experiment_over(model, fine.window(), fine.motion(), DENSITY)?;
    let is_coarser = 2 * coarse.mesh_size()[0] <= fine.mesh_size()[0];
    Ok(Some(coarse).filter(|_| is_coarser))
}

/// The reduced model's problem for a measured field of a specimen that the load turns by `own`, rad; on the mesh of an experiment that is
/// `known`, where that is of the same specimen under the same load.
///
/// # Errors
/// Those of [`Problem::validate`]; a specimen that cannot be meshed.
pub fn problem_of(
    model: &Model,
    field: &Field,
    own: f64,
    known: Option<&dyn FieldSolver>,
) -> Result<Problem> {
    let imaged = model.experiment().measurement.image_correlation.is_some();
    let motion = if imaged {
        rigid::fit(&field.points, &field.displacement).with_own(own)
    } else {
        RigidMotion::NONE
    };
    problem_over(model, field.measured_bounds(), motion, known)
}

/// The same for a window of measured points, where nothing is known of how the specimen moves.
///
/// # Errors
/// Those of [`problem_of`].
pub fn problem_within(
    model: &Model,
    window: [[f64; 2]; 2],
    known: Option<&dyn FieldSolver>,
) -> Result<Problem> {
    problem_over(model, window, RigidMotion::NONE, known)
}

fn problem_over(
    model: &Model,
    window: [[f64; 2]; 2],
    motion: RigidMotion,
    known: Option<&dyn FieldSolver>,
) -> Result<Problem> {
    let experiment = experiment_on(known, model, (window, motion, 1.0))?;
    let problem = Problem {
        dimensions: dimensions_of(model, &*experiment)?,
        experiment,
        spec: model.file.reduced_model.clone(),
    };
    problem
        .validate()
        .map_err(|e| e.within(model.path.display()))?;
    Ok(problem)
}
