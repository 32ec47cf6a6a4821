//! Experiments: the one forward model. Reduction, tracing, simulation and the check against the finite elements call
//! [`predict`]; nobody else solves, gauges, images or observes.
//!
//! A field is observed in stages, each one function: mechanics and camera ([`Mechanics::look`]), gauge ([`gauged`]), added
//! displacements and recording.

mod bending;
mod field;
mod field_test;
pub mod frequencies;
mod gauge;
mod mesh_error;
mod mock;
mod sensitivity;
pub mod series;
mod sight;
pub mod simulate;
mod smoothing;
mod solver;
mod spec;
mod state;
mod subset;
mod window;

pub use field::FieldExperiment;
pub use field_test::FieldTest;
pub use gauge::{Gauge, check as check_gauge, gauged};
pub use mock::MockExperiment;
pub use sensitivity::{Direction, Neighbourhood, pictured, sensitivity};
pub use sight::PointSet;
pub use solver::{
    CameraField, FieldSolver, Given, Mechanics, NEAR_EDGE_HARMONICS, NEAR_EDGE_REACH, Places,
    Softening, Spanning,
};
pub use spec::{ExperimentKind, ExperimentSpec, StepForces, check_name};
pub use state::State;
pub use subset::{Imaging, Subsets};

use crate::effect::{Acting, Kind, Scene};
use crate::error::Result;
use crate::fem::Anchor;

/// A predicted field at a sight's points, without `further` ones.
pub struct Prediction {
    /// Displacement (u1, u2), mm, with everything that acts but what the instrument records.
    pub field: Vec<[f64; 2]>,
    /// The part that the load causes, under the gauge, mm.
    pub loaded: Vec<[f64; 2]>,
    /// The same before the gauge.
    pub look: CameraField,
}

/// Predict what a state shows.
///
/// # Errors
/// Those of [`Mechanics::look`].
pub fn predict(
    experiment: &dyn FieldSolver,
    state: &State,
    sight: &PointSet,
) -> Result<Prediction> {
    let look = experiment.look(state, sight, false)?;
    observe(experiment, state, sight, look)
}

/// The same near an anchor's state, for differences.
///
/// # Errors
/// Those of [`Mechanics::look`].
pub fn predict_near(
    experiment: &dyn FieldSolver,
    about: Option<&Anchor>,
    state: &State,
    sight: &PointSet,
) -> Result<Prediction> {
    let look = experiment.look_near(about, state, sight)?;
    observe(experiment, state, sight, look)
}

/// The same with the gradient, about which `sensitivity` linearises.
///
/// # Errors
/// Those of [`Mechanics::look`].
pub fn predict_with_gradient(
    experiment: &dyn FieldSolver,
    state: &State,
    sight: &PointSet,
) -> Result<Prediction> {
    let look = experiment.look(state, sight, true)?;
    observe(experiment, state, sight, look)
}

/// What follows the camera: gauge and added displacements.
fn observe(
    experiment: &dyn FieldSolver,
    state: &State,
    sight: &PointSet,
    look: CameraField,
) -> Result<Prediction> {
    let loaded = gauged(experiment.gauge(), sight, &look.displacement);
    let mut field = loaded.clone();
    let additive = |a: &&Acting| a.effect.kind() == Kind::Additive;
    for a in state.acting().iter().filter(additive) {
        let added = experiment.added(a.effect, &a.amplitude, sight)?;
        for (u, added) in field.iter_mut().zip(added) {
            *u = [u[0] + added[0], u[1] + added[1]];
        }
    }
    Ok(Prediction {
        field,
        loaded,
        look,
    })
}

/// What the instrument records of a field (mm, rigid motion included).
pub fn record(acting: &[Acting], scene: &Scene, points: &[[f64; 2]], field: &mut [[f64; 2]]) {
    for a in acting.iter().filter(|a| a.effect.kind() == Kind::Recorded) {
        for (u, &p) in field.iter_mut().zip(points) {
            *u = a.effect.recorded(&a.amplitude, scene, p, *u);
        }
    }
}

/// By which a field under a prescribed force changes with a common factor of all moduli and with the thickness h: it is
/// 1 / (h E1) times a function of the moduli's ratios. Effects that break this say so ([`crate::effect::Effect::scales`]).
pub fn load_response(e1: f64, thickness: f64) -> f64 {
    1.0 / (e1 * thickness)
}
