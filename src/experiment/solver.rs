//! What the field solver can do, one trait an ability: mechanics and camera, places, and what makes many predictions cheap.

use std::sync::Arc;

use rayon::prelude::*;

use super::field_test::FieldTest;
use super::gauge::Gauge;
use super::mesh_error::MeshError;
use super::sight::PointSet;
use super::state::State;
use crate::effect::{Effect, Scene};
use crate::error::{Error, Result};
use crate::fem::{Anchor, Answer, Bump, Certificate, EdgeStress, Plate, View};
use crate::field::rigid::RigidMotion;

/// What a specimen under load shows a camera. Points are (s, t) and displacements (u1, u2), both in mm, direction 1 along the load, origin at
/// the hole's centre or the declared origin.
pub trait Mechanics: Send + Sync {
    /// What effects need to know of the nominal test.
    fn scene(&self) -> &Scene;

    fn gauge(&self) -> Gauge;

    /// How the specimen moves in the plane beside what the load does to it, as the data show it: what image correlation makes of an
    /// optical effect depends on it.
    fn motion(&self) -> RigidMotion {
        RigidMotion::NONE
    }

    /// Whether edges of the specimen are held, so that the load turns it as it strains it, to first order. Fields of another solver may have that
    /// rotation to any order, and are not taken for such.
    fn is_held(&self) -> bool {
        false
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
    fn look(&self, state: &State, sight: &PointSet, gradient: bool) -> Result<CameraField>;

    /// The displacement, mm, that an additive effect of some amplitudes (border units) adds at a sight's points, without `further` ones. It is
    /// linear in the amplitudes.
    ///
    /// # Errors
    /// Those of the mechanics.
    fn added(&self, of: &dyn Effect, amplitude: &[f64], sight: &PointSet) -> Result<Vec<[f64; 2]>> {
        Ok(in_closed_form(self.scene(), of, amplitude, sight))
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
        _sight: &PointSet,
    ) -> Result<Option<Vec<f64>>> {
        Ok(None)
    }

    /// What changes of the stiffness add, to first order, as the camera reports it at a sight's points, mm. None without an anchor.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn softened(
        &self,
        _about: Option<&Anchor>,
        _state: &State,
        _sight: &PointSet,
        _softening: Softening<'_>,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        Ok(Vec::new())
    }

    /// What makes [`Mechanics::look_near`] cheap about a state under some times its load; none where a look costs nothing.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn anchor(&self, _about: &State, _times: &[f64]) -> Result<Option<Anchor>> {
        Ok(None)
    }

    /// [`Mechanics::look`], without the gradient, at a state so near to an anchor's that only differences matter.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn look_near(
        &self,
        about: Option<&Anchor>,
        state: &State,
        sight: &PointSet,
    ) -> Result<CameraField> {
        let mut looks = self.looks_near(about, std::slice::from_ref(state), sight)?;
        looks
            .pop()
            .ok_or_else(|| Error::program("Mechanics::looks_near", "a look at each state"))
    }

    /// The same at states that differ by their force alone.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn looks_near(
        &self,
        _about: Option<&Anchor>,
        states: &[State],
        sight: &PointSet,
    ) -> Result<Vec<CameraField>> {
        let look = |state| self.look(state, sight, false);
        states.iter().map(look).collect()
    }

    /// The highest von Mises stress at an edge that carries no load, as if nothing yielded, for an isotropic material; none where the
    /// experiment knows no stresses.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn edge_stress(&self, _state: &State) -> Result<Option<EdgeStress>> {
        Ok(None)
    }

    /// How far a mesh that another program made is from a finer one; none where the mesh is the geometry's own.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn mesh_error(&self, _state: &State) -> Result<Option<MeshError>> {
        Ok(None)
    }
}

/// Where on the specimen a field is known and seen.
pub trait Places: Send + Sync {
    /// Bounding box of the measured points, low and high corner, mm.
    fn window(&self) -> [[f64; 2]; 2];

    /// Points at which a field is known well enough to be continued over the window: where reduced models keep it.
    fn support(&self) -> &PointSet;

    /// A field on the points of a sight, `further` ones included, from its values at [`Places::support`].
    fn spread(&self, at_support: &[[f64; 2]], sight: &PointSet) -> Vec<[f64; 2]>;

    /// The points of the nominal specimen among `points` and `further`, and which of `points` those are.
    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (PointSet, Vec<bool>);

    /// Points and further ones that all show the specimen, with their places on this mesh; beside it the field is continued.
    fn extended(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> PointSet {
        PointSet::anywhere(points, further)
    }

    /// Reported points whose place on the mesh is not known yet; each stands for its subset where images are correlated.
    fn sight(&self, points: &[[f64; 2]]) -> PointSet {
        PointSet::anywhere(points, &[])
    }
}

/// What makes many predictions cheap: a reduced basis, or snapshots of another program.
pub trait Spanning: Send + Sync {
    /// The mesh with what was solved on it, for a test of the same specimen under the same load; none of another one, or where the own finite
    /// elements do not answer. An imported mesh has its file's shape: both are of one run.
    fn plate_of(&self, _test: &FieldTest) -> Option<Arc<Plate>> {
        None
    }

    /// Elements and unknowns of the mesh; zeros without one.
    fn mesh_size(&self) -> [usize; 2];

    /// What another program solved; none where the own finite elements answer.
    fn given(&self) -> Option<Given<'_>> {
        None
    }

    /// Make many predictions about states like these cheap from now on, at no loss that can be seen.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn span(&self, _states: &[State]) -> Result<()> {
        Ok(())
    }

    /// Fields at a sight's points, under the gauge, mm, whose sums are what the load causes in states that [`Spanning::coordinates`]
    /// knows; empty before [`Spanning::span`].
    fn spanning(&self, _sight: &PointSet) -> Vec<Vec<[f64; 2]>> {
        Vec::new()
    }

    /// The answer in a state, whose coordinates are the factors of those fields; none where its field is not such a sum.
    fn coordinates(&self, _state: &State) -> Option<Answer> {
        None
    }

    /// The basis of those answers as a sight's points see it, under the gauge; none before [`Spanning::span`].
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn view(&self, _sight: &PointSet) -> Result<Option<View>> {
        Ok(None)
    }

    /// Hold the reduced basis against the solver in some states, at a sight's points; empty where there is none.
    ///
    /// # Errors
    /// Those of [`Mechanics::look`].
    fn certify(&self, _states: &[State], _sight: &PointSet) -> Result<Vec<Certificate>> {
        Ok(Vec::new())
    }

    /// Free what is kept between predictions.
    fn drop_caches(&self) {}
}

/// A specimen whose field can be predicted and reduced.
pub trait FieldSolver: Mechanics + Places + Spanning {}

impl<T: Mechanics + Places + Spanning> FieldSolver for T {}

/// A design that another program solved.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// One row a snapshot: the constants, and the thickness where it varies, border units.
    pub rows: &'a [Vec<f64>],
    /// The rows' fields at [`Places::support`], mm.
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
pub struct CameraField {
    /// Displacement (u1, u2), mm.
    pub displacement: Vec<[f64; 2]>,
    /// Displacement of the specimen at the true points, before the camera, mm.
    pub loaded: Vec<[f64; 2]>,
    /// Gradient of that displacement, `g[i][k]` = d u_i / d x_k; empty where it was not asked for.
    pub gradient: Vec<[[f64; 2]; 2]>,
}

/// The closed form of what an additive effect adds at a sight's points.
pub(super) fn in_closed_form(
    scene: &Scene,
    effect: &dyn Effect,
    amplitude: &[f64],
    sight: &PointSet,
) -> Vec<[f64; 2]> {
    let points = sight.points().par_iter();
    points
        .map(|&p| effect.displacement(amplitude, scene, p))
        .collect()
}
