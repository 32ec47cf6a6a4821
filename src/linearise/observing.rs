//! How the displacements of a test are observed.

use super::column::{Column, StepStack};
use crate::effect::{Effect, Scene};
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{Direction, FieldSolver, PointSet, Softening, State};
use crate::infer::Model;

/// What of a test is observed, and how: at all points of a field, or at the places of averages over them in every step.
pub trait Observing: Sync {
    fn experiment(&self) -> &dyn FieldSolver;

    /// The points that are looked at.
    fn sight(&self) -> &PointSet;

    /// Names of the steps.
    fn names(&self) -> &[String];

    /// Prior sd of an amplitude, border units.
    fn prior_sd(&self, model: &Model, effect: &dyn Effect, k: usize) -> f64;

    /// A state of the steps as they are declared, with nothing of their own but the motion in the plane.
    fn beginning(&self, shared: State) -> SeriesState;

    /// What all steps show at a state, where slopes are looked at, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    fn shown(&self, at: &SeriesState) -> Result<StepStack>;

    /// The same about a state.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    fn about<'a>(&'a self, at: &'a SeriesState) -> Result<Box<dyn ObservedAbout + 'a>>;

    /// Whether forces that are not known and motion in the plane are every step's own. Of a single one the force is the load's scale, and
    /// the motion an effect.
    fn of_each_step(&self) -> bool;
}

/// What is observed about a state.
pub trait ObservedAbout: Sync {
    /// What all steps show, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    fn predicted(&self) -> Result<StepStack>;

    /// What the camera of a scene reports, mm, in a state that differs by the picture or the motion alone; up to what additive effects of a
    /// field add.
    fn reported(&self, state: &SeriesState, scene: &Scene) -> StepStack;

    /// The change for one border unit along a direction, mm, by a difference that reaches `step` of them to either side; an amplitude
    /// that has a law with its `weights` in the steps.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    fn slope(&self, direction: Direction, weights: &[f64], step: f64) -> Result<StepStack>;

    /// What changes of the stiffness do, mm.
    ///
    /// # Errors
    /// Those of [`crate::experiment::Mechanics::softened`].
    fn softened(&self, softening: Softening<'_>) -> Result<Vec<StepStack>>;

    /// What all steps show of a field at the points that grows with the load, mm under a full one.
    fn with_the_load(&self, field: &[[f64; 2]]) -> StepStack;

    /// Columns of what is every step's own: forces that are not known, motion in the plane, shifts of a wave that a state has.
    fn of_steps(&self) -> Vec<Column>;
}

/// (high - low) / `over`.
pub(super) fn quotient([high, low]: [StepStack; 2], over: f64) -> StepStack {
    let [a, b] = high;
    let [c, d] = low;
    [(a - c) / over, (b - d) / over]
}
