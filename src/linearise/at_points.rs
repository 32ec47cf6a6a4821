//! A field observed at all of its points, which are then averaged over blocks; its slopes by the chain rule where that is exact.

use super::column::{Column, StepStack};
use super::observing::{ObservedAbout, Observing};
use super::slopes::Slopes;
use crate::effect::{Effect, Scene};
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{
    Direction, FieldSolver, Neighbourhood, PointSet, Prediction, Softening, State, gauged,
    pictured, predict, predict_with_gradient, sensitivity,
};
use crate::fem::Anchor;
use crate::infer::Model;
use crate::quantity::UM_PER_MM;

/// A field of one load.
pub struct AtPoints<'a> {
    pub experiment: &'a dyn FieldSolver,
    pub slopes: Slopes<'a>,
    /// Root mean square of the measured displacements, mm: what scales the prior of amplitudes that nothing bounds.
    pub size_mm: f64,
}

/// Prior sd of an amplitude that nothing bounds, times the size of the measured field.
const FREE: f64 = 10.0;

/// Rotation that goes with near-edge stresses of the nominal size, rad.
const ROTATION: f64 = 1e-3;

impl Observing for AtPoints<'_> {
    fn experiment(&self) -> &dyn FieldSolver {
        self.experiment
    }

    fn sight(&self) -> &PointSet {
        self.slopes.sight()
    }

    fn names(&self) -> &[String] {
        &[]
    }

    fn prior_sd(&self, model: &Model, effect: &dyn Effect, k: usize) -> f64 {
        // only translations are free: their unit is the micrometre
        let free = FREE * self.size_mm * UM_PER_MM;
        model.prior_sd(effect, k).unwrap_or(free)
    }

    fn beginning(&self, shared: State) -> SeriesState {
        SeriesState::of_one_step(shared)
    }

    fn shown(&self, at: &SeriesState) -> Result<StepStack> {
        let predicted = predict(self.experiment, &at.shared, self.slopes.sight())?;
        Ok(self.slopes.average(&predicted.field))
    }

    fn about<'a>(&'a self, at: &'a SeriesState) -> Result<Box<dyn ObservedAbout + 'a>> {
        Ok(Box::new(AboutPoints {
            observing: self,
            here: predict_with_gradient(self.experiment, &at.shared, self.slopes.sight())?,
            anchor: self.experiment.anchor(&at.shared, &[1.0])?,
            at,
        }))
    }

    fn of_each_step(&self) -> bool {
        false
    }
}

struct AboutPoints<'a> {
    observing: &'a AtPoints<'a>,
    here: Prediction,
    anchor: Option<Anchor>,
    at: &'a SeriesState,
}

impl AboutPoints<'_> {
    fn about(&self) -> Neighbourhood<'_> {
        Neighbourhood {
            at: &self.at.shared,
            here: &self.here,
            anchor: self.anchor.as_ref(),
        }
    }
}

impl ObservedAbout for AboutPoints<'_> {
    fn predicted(&self) -> Result<StepStack> {
        let AtPoints {
            experiment, slopes, ..
        } = self.observing;
        slopes.predicted(*experiment, &self.at.shared, &self.here)
    }

    fn reported(&self, state: &SeriesState, scene: &Scene) -> StepStack {
        let AtPoints {
            experiment, slopes, ..
        } = self.observing;
        let sight = slopes.sight();
        let reported = pictured(*experiment, &self.about(), sight, &state.shared, scene);
        slopes.average(&gauged(experiment.gauge(), sight, &reported))
    }

    fn slope(&self, direction: Direction, _weights: &[f64], step: f64) -> Result<StepStack> {
        let AtPoints {
            experiment, slopes, ..
        } = self.observing;
        let slope = sensitivity(*experiment, &self.about(), slopes.sight(), direction, step)?;
        Ok(slopes.average(&slope))
    }

    /// Near an edge with a rotation in the plane besides, since no rig holds a specimen to a microradian.
    fn softened(&self, softening: Softening<'_>) -> Result<Vec<StepStack>> {
        let AtPoints {
            experiment, slopes, ..
        } = self.observing;
        let (sight, about) = (slopes.sight(), self.anchor.as_ref());
        let mut fields = experiment.softened(about, &self.at.shared, sight, softening)?;
        if !fields.is_empty() {
            let turned = |p: &[f64; 2]| [-ROTATION * p[1], ROTATION * p[0]];
            fields.push(sight.points().iter().map(turned).collect());
        }
        Ok(fields.iter().map(|u| slopes.average(u)).collect())
    }

    fn with_the_load(&self, field: &[[f64; 2]]) -> StepStack {
        let AtPoints {
            experiment, slopes, ..
        } = self.observing;
        slopes.average(&gauged(experiment.gauge(), slopes.sight(), field))
    }

    fn of_steps(&self) -> Vec<Column> {
        Vec::new()
    }
}
