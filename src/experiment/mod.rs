//! Experiments: the one forward model. Reduction, tracing, simulation and the check against the finite elements call
//! [`predict`]; nobody else solves, gauges, images or observes.
//!
//! A field is observed in stages, each one function: mechanics and camera ([`Experiment::look`]), gauge ([`gauged`]), added
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
mod spec;
mod state;
mod subset;
mod window;

pub use field::FieldExperiment;
pub use field_test::FieldTest;
pub use gauge::{Gauge, check as check_gauge, gauged};
pub use mesh_error::MeshError;
pub use mock::MockExperiment;
pub use sensitivity::{Direction, between, beyond_the_axis, sensitivity};
pub use sight::Sight;
pub use spec::{ExperimentKind, ExperimentSpec, check_name};
pub use state::State;
pub use subset::{Images, Subsets};

use rayon::prelude::*;

use crate::effect::{Acting, Effect, Kind, Scene};
use crate::error::Result;
use crate::fem::{Anchor, Answer, Bump, Certificate, EdgeStress, View};
use crate::field::rigid::RigidMotion;

/// A test whose outcome can be predicted: an experiment on a specimen of the material. Points are (s, t) and displacements
/// (u1, u2), both in mm, direction 1 along the load, origin at the hole's centre or the declared origin.
pub trait Experiment: Send + Sync {
    /// What effects need to know of the nominal test.
    fn scene(&self) -> &Scene;

    fn gauge(&self) -> Gauge;

    /// How the specimen moves in the plane beside what the load does to it, as the data show it: what image correlation makes of an
    /// optical effect depends on it.
    fn motion(&self) -> RigidMotion {
        RigidMotion::NONE
    }

    /// Bounding box of the measured points, low and high corner, mm.
    fn window(&self) -> [[f64; 2]; 2];

    /// Everything that determines the prediction, for the key under which a reduced model is kept.
    fn serialisation(&self) -> serde_json::Value;

    /// Elements and unknowns of the mesh; zeros without one.
    fn mesh_size(&self) -> [usize; 2];

    /// Points at which a field is known well enough to be continued over the window: where reduced models keep it.
    fn support(&self) -> &Sight;

    /// A field on the points of a sight, `further` ones included, from its values at [`Experiment::support`].
    fn spread(&self, at_support: &[[f64; 2]], sight: &Sight) -> Vec<[f64; 2]>;

    /// The points of the nominal specimen among `points` and `further`, and which of `points` those are.
    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (Sight, Vec<bool>);

    /// Reported points whose place on the mesh is not known yet; each stands for its subset where images are correlated.
    fn sight(&self, points: &[[f64; 2]]) -> Sight {
        Sight::anywhere(points, &[])
    }

    /// Which reported points show the specimen, as the effects of a state leave it.
    ///
    /// # Errors
    /// A state in which the specimen cannot be.
    fn shows(&self, state: &State, points: &[[f64; 2]]) -> Result<Vec<bool>>;

    /// What the camera reports of the loaded specimen at a sight's points, with its gradient where that is asked for.
    ///
    /// # Errors
    /// Those of the mechanics; constants that are not admissible.
    fn look(&self, state: &State, sight: &Sight, gradient: bool) -> Result<Look>;

    /// The displacement, mm, that an additive effect of some amplitudes (border units) adds at a sight's points, without `further` ones. It is
    /// linear in the amplitudes.
    ///
    /// # Errors
    /// Those of the mechanics.
    fn added(
        &self,
        effect: &dyn Effect,
        amplitude: &[f64],
        sight: &Sight,
    ) -> Result<Vec<[f64; 2]>> {
        Ok(in_closed_form(self.scene(), effect, amplitude, sight))
    }

    /// What an additive effect that bends the specimen towards the camera adds, at a sight's points without `further` ones, along each direction
    /// in which the camera's axis lies farther from the middle of the window, mm a mm. None of another effect, or without a camera's distance.
    ///
    /// # Errors
    /// Those of the mechanics.
    fn off_axis(
        &self,
        _effect: &dyn Effect,
        _amplitude: &[f64],
        _sight: &Sight,
    ) -> Result<Option<Vec<f64>>> {
        Ok(None)
    }

    /// What changes of the stiffness add, to first order, as the camera reports it at a sight's points, mm. None without an anchor.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn softened(
        &self,
        _about: Option<&Anchor>,
        _state: &State,
        _sight: &Sight,
        _softening: Softening<'_>,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        Ok(Vec::new())
    }

    /// What makes [`Experiment::look_near`] cheap about a state; none where a look costs nothing.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn anchor(&self, _about: &State) -> Result<Option<Anchor>> {
        Ok(None)
    }

    /// [`Experiment::look`], without the gradient, at a state so near to an anchor's that only differences matter.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn look_near(&self, _about: Option<&Anchor>, state: &State, sight: &Sight) -> Result<Look> {
        self.look(state, sight, false)
    }

    /// The highest von Mises stress at an edge that carries no load, as if nothing yielded, for an isotropic material; none where the
    /// experiment knows no stresses.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn edge_stress(&self, _state: &State) -> Result<Option<EdgeStress>> {
        Ok(None)
    }

    /// How far a mesh that another program made is from a finer one; none where the mesh is the geometry's own.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn mesh_error(&self, _state: &State) -> Result<Option<MeshError>> {
        Ok(None)
    }

    /// What another program solved; none where the own finite elements answer.
    fn given(&self) -> Option<Given<'_>> {
        None
    }

    /// Make many predictions about states like these cheap from now on, at no loss that can be seen.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn span(&self, _states: &[State]) -> Result<()> {
        Ok(())
    }

    /// Fields at a sight's points, under the gauge, mm, whose sums are what the load causes in states that [`Experiment::coordinates`]
    /// knows; empty before [`Experiment::span`].
    fn spanning(&self, _sight: &Sight) -> Vec<Vec<[f64; 2]>> {
        Vec::new()
    }

    /// The answer in a state, whose coordinates are the factors of those fields; none where its field is not such a sum.
    fn coordinates(&self, _state: &State) -> Option<Answer> {
        None
    }

    /// The basis of those answers as a sight's points see it, under the gauge; none before [`Experiment::span`].
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn view(&self, _sight: &Sight) -> Result<Option<View>> {
        Ok(None)
    }

    /// Hold the reduced basis against the solver in some states, at a sight's points; empty where there is none.
    ///
    /// # Errors
    /// Those of [`Experiment::look`].
    fn certify(&self, _states: &[State], _sight: &Sight) -> Result<Vec<Certificate>> {
        Ok(Vec::new())
    }

    /// Free what is kept between predictions.
    fn rest(&self) {}
}

/// A design that another program solved.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// One row a snapshot: the constants, and the thickness where it varies, border units.
    pub rows: &'a [Vec<f64>],
    /// The rows' fields at [`Experiment::support`], mm.
    pub fields: &'a [Vec<[f64; 2]>],
}

/// Changes of the stiffness that no effect of the dictionary is.
#[derive(Clone, Copy)]
pub enum Softening<'a> {
    /// Any within [`NEAR_EDGE_REACH`] radii of the hole: fields of initial stresses there that are as large as the nominal stress of the
    /// specimen's gross section. None without a hole.
    NearEdge,
    /// Of the relative membrane stiffness by some bumps, one unit each.
    Bumps(&'a [Bump]),
}

/// Hole radii within which the near-edge rival's stresses act, and the harmonics of their distribution.
pub const NEAR_EDGE_REACH: f64 = 1.3;
pub const NEAR_EDGE_HARMONICS: usize = 4;

/// A field as the camera reports it, before the gauge. One entry a point of the sight, `further` ones included.
pub struct Look {
    /// Displacement (u1, u2), mm.
    pub displacement: Vec<[f64; 2]>,
    /// Displacement of the specimen at the true points, before the camera, mm.
    pub loaded: Vec<[f64; 2]>,
    /// Gradient of that displacement, `g[i][k]` = d u_i / d x_k; empty where it was not asked for.
    pub gradient: Vec<[[f64; 2]; 2]>,
}

/// A predicted field at a sight's points, without `further` ones.
pub struct Prediction {
    /// Displacement (u1, u2), mm, with everything that acts but what the instrument records.
    pub field: Vec<[f64; 2]>,
    /// The part that the load causes, under the gauge, mm.
    pub loaded: Vec<[f64; 2]>,
    /// The same before the gauge.
    pub look: Look,
}

/// Predict what a state shows.
///
/// # Errors
/// Those of [`Experiment::look`].
pub fn predict(experiment: &dyn Experiment, state: &State, sight: &Sight) -> Result<Prediction> {
    let look = experiment.look(state, sight, false)?;
    observe(experiment, state, sight, look)
}

/// The same near an anchor's state, for differences.
///
/// # Errors
/// Those of [`Experiment::look`].
pub fn predict_near(
    experiment: &dyn Experiment,
    about: Option<&Anchor>,
    state: &State,
    sight: &Sight,
) -> Result<Prediction> {
    let look = experiment.look_near(about, state, sight)?;
    observe(experiment, state, sight, look)
}

/// The same with the gradient, about which [`sensitivity`] linearises.
///
/// # Errors
/// Those of [`Experiment::look`].
pub fn predict_with_gradient(
    experiment: &dyn Experiment,
    state: &State,
    sight: &Sight,
) -> Result<Prediction> {
    let look = experiment.look(state, sight, true)?;
    observe(experiment, state, sight, look)
}

/// What follows the camera: gauge and added displacements.
fn observe(
    experiment: &dyn Experiment,
    state: &State,
    sight: &Sight,
    look: Look,
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

/// The closed form of what an additive effect adds at a sight's points.
fn in_closed_form(
    scene: &Scene,
    effect: &dyn Effect,
    amplitude: &[f64],
    sight: &Sight,
) -> Vec<[f64; 2]> {
    let points = sight.points().par_iter();
    points
        .map(|&p| effect.displacement(amplitude, scene, p))
        .collect()
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
