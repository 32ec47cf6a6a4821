//! The test linearised about a state: its prediction there, and what a change of every constant and of every effect's amplitude
//! does to it, as block averages.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::effect::{Effect, Kind, LOAD_SCALE, amplitude_name};
use crate::error::Result;
use crate::experiment::series::Law;
use crate::experiment::{
    Direction, FieldSolver, Prediction, Sight, Softening, State, predict, predict_with_gradient,
    sensitivity,
};
use crate::fem::Anchor;
use crate::field::blocks::one_a_tile;
use crate::field::{Blocks, Field};
use crate::identify::Prepared;
use crate::infer::{Known, LENS, Model};
use crate::laminate::MeanSd;
use crate::reduce::THICKNESS;

pub use crate::infer::Column;

/// An effect that the model lacks, or might.
#[derive(Clone)]
pub struct Candidate {
    pub effect: &'static dyn Effect,
    /// How its amplitude goes over the steps of a series, where it is another in each.
    pub law: Option<Law>,
    pub columns: Vec<Column>,
}

/// The prediction linearised about a state.
#[derive(Clone)]
pub struct Sensitivities {
    /// Block averages of (u1, u2) at the prior means of all parameters, by this linearisation, mm.
    pub predicted: [DVector<f64>; 2],
    /// Elastic constants, the thickness if it is uncertain, the load's scale, declared effects.
    pub base: Vec<Column>,
    /// How many of `base` are elastic constants.
    pub constants: usize,
    /// Effects that are not declared.
    pub candidates: Vec<Candidate>,
    /// Block averages of (u1, u2), mm, of the near-edge rival's fields ([`Softening::NearEdge`]); none where no
    /// effect is a candidate.
    pub near_edge: Vec<[DVector<f64>; 2]>,
    /// What experiments beside the field say of the constants.
    pub known: Option<Arc<Known>>,
}

impl Sensitivities {
    /// Add what other experiments say to normal equations X'X, X'y of columns that begin with the constants.
    pub fn add_known(&self, gram: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        if let Some(known) = &self.known {
            known.add_to(gram, right);
        }
    }

    /// Whether all that is predicted, and all columns, are numbers.
    pub fn is_finite(&self) -> bool {
        let sought = self.candidates.iter().flat_map(|c| &c.columns);
        let columns = self.base.iter().chain(sought).map(|c| &c.values);
        let all = columns.chain(&self.near_edge).chain([&self.predicted]);
        all.flatten().flatten().all(|v| v.is_finite())
    }

    /// Carry the prediction to the prior means of some parameters.
    pub fn carry(&mut self, columns: &[Column]) {
        move_to_means(&mut self.predicted, columns.iter());
    }

    /// Carry the prediction from where it was linearised to the prior means of all parameters.
    pub fn carry_to_means(&mut self) {
        let sought = self.candidates.iter().flat_map(|c| &c.columns);
        move_to_means(&mut self.predicted, self.base.iter().chain(sought));
    }
}

/// The measured field as block averages; of a series those of all steps, one step after the other.
pub struct Measured {
    pub blocks: Blocks,
    /// Averages of (u1, u2), mm.
    pub averages: [DVector<f64>; 2],
}

impl Measured {
    /// Of the points of a field that are `used`. Blocks are 0.6 to 1 mm wide, at least half full
    /// (prototype study): small beside the fields of effects, large enough for a covariance of a thousand values.
    pub fn new(field: &Field, used: impl Fn(usize) -> bool) -> Self {
        let blocks = Blocks::new(field, Blocks::size_for(field), used);
        Self {
            averages: averages(&blocks, &field.displacement),
            blocks,
        }
    }

    /// Measured minus predicted at the prior means of all parameters: block averages of (u1, u2), mm.
    pub fn residual(&self, sensitivities: &Sensitivities) -> [DVector<f64>; 2] {
        [0, 1].map(|c| &self.averages[c] - &sensitivities.predicted[c])
    }
}

/// Block averages of both components of a field.
fn averages(blocks: &Blocks, field: &[[f64; 2]]) -> [DVector<f64>; 2] {
    [0, 1].map(|c| {
        let values: Vec<f64> = field.iter().map(|u| u[c]).collect();
        blocks.average(&values)
    })
}

pub struct Linearised<'a> {
    pub model: &'a Model,
    pub experiment: &'a dyn FieldSolver,
    /// Root mean square of the measured displacements, mm: what scales the prior of amplitudes that nothing bounds.
    pub size_mm: f64,
    /// Where predictions and slopes are looked at.
    pub few: Few<'a>,
    pub step: &'a (dyn Fn() + Sync),
}

/// Points over which slopes are averaged: all, or of blocks of hundreds of points some that stand for the others. A slope within a block
/// is a plane but for a thousandth; the prediction itself, which is held against the data, is averaged over all points.
pub enum Few<'a> {
    All(&'a Sight, &'a Blocks),
    /// The points that stand for all of the others.
    Some(Box<(Sight, Blocks)>, &'a Sight, &'a Blocks),
    /// Single points in place of averages.
    Points(&'a Sight),
}

/// Along a side of a block, points that stand for the others.
const ALONG: f64 = 8.0;

impl<'a> Few<'a> {
    /// Of a prepared model's points in blocks.
    pub fn new(prepared: &'a Prepared, blocks: &'a Blocks) -> Self {
        let sight = &prepared.observation.sight;
        Self::some(prepared, blocks).map_or(Self::All(sight, blocks), |few| {
            Self::Some(few.into(), sight, blocks)
        })
    }

    fn some(prepared: &Prepared, blocks: &Blocks) -> Option<(Sight, Blocks)> {
        if blocks.mean_count() < 2.0 * ALONG * ALONG {
            return None;
        }
        let points = prepared.observation.sight.points();
        let kept = one_a_tile(points, blocks.size_mm / ALONG);
        let kept: Vec<usize> = (0..points.len())
            .filter(|&i| kept[i] && blocks.of_point[i].is_some())
            .collect();
        let places: Vec<[f64; 2]> = kept.iter().map(|&i| points[i]).collect();
        let (sight, inside) = prepared.problem.experiment.locate(&places, &[]);
        let of_point: Vec<Option<u32>> = kept.iter().map(|&i| blocks.of_point[i]).collect();
        let few = blocks.thinned(of_point)?;
        inside.iter().all(|i| *i).then_some((sight, few))
    }

    pub(super) fn sight(&self) -> &Sight {
        match self {
            Self::All(sight, _) | Self::Points(sight) => sight,
            Self::Some(few, ..) => &few.0,
        }
    }

    pub(super) fn average(&self, field: &[[f64; 2]]) -> [DVector<f64>; 2] {
        match self {
            Self::All(_, blocks) => averages(blocks, field),
            Self::Some(few, ..) => averages(&few.1, field),
            Self::Points(_) => {
                [0, 1].map(|c| DVector::from_iterator(field.len(), field.iter().map(|u| u[c])))
            }
        }
    }

    /// The prediction, which is `here` at the points of slopes.
    fn predicted(
        &self,
        experiment: &dyn FieldSolver,
        at: &State,
        here: &Prediction,
    ) -> Result<[DVector<f64>; 2]> {
        match self {
            Self::Some(_, sight, blocks) => {
                Ok(averages(blocks, &predict(experiment, at, sight)?.field))
            }
            _ => Ok(self.average(&here.field)),
        }
    }
}

/// One direction a parameter.
fn amplitudes(effect: &&'static dyn Effect) -> impl Iterator<Item = Direction> + use<> {
    let effect = *effect;
    (0..effect.parameters().len()).map(move |k| Direction::Amplitude(effect, k))
}

/// Step of an elastic constant's central difference, as a fraction of its value.
const CONSTANT_STEP: f64 = 0.01;

/// Step of an amplitude's central difference, prior sds.
const AMPLITUDE_STEP: f64 = 0.5;

/// Rotation that goes with near-edge stresses of the nominal size, rad.
const ROTATION: f64 = 1e-3;

/// Prior sd of an amplitude that nothing bounds, times the size of the measured field.
const FREE: f64 = 10.0;

impl Linearised<'_> {
    /// Linearise at a state, for the declared effects and `candidates`.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn sensitivities(
        &self,
        at: &State,
        candidates: &[&'static dyn Effect],
    ) -> Result<Sensitivities> {
        let experiment = self.experiment;
        let here = predict_with_gradient(experiment, at, self.few.sight())?;
        let anchor = experiment.anchor(at)?;
        let about = (at, anchor.as_ref());
        let mut directions = self.base();
        let declared = directions.len();
        directions.extend(candidates.iter().flat_map(amplitudes));
        let columns: Vec<Column> = directions
            .par_iter()
            .map(|&direction| {
                let column = self.column(about, &here, direction);
                (self.step)();
                column
            })
            .collect::<Result<_>>()?;
        let mut predicted = self.few.predicted(experiment, at, &here)?;
        move_to_means(&mut predicted, columns.iter());
        let near_edge = if candidates.is_empty() {
            Vec::new()
        } else {
            self.rival(about)?
        };
        let near_edge = near_edge.iter().map(|u| self.few.average(u)).collect();
        let mut columns = columns.into_iter();
        let base = columns.by_ref().take(declared).collect();
        let candidate = |&effect: &&'static dyn Effect| -> Result<Candidate> {
            let mut own: Vec<Column> = columns.by_ref().take(effect.parameters().len()).collect();
            self.of_the_lens_center((at, &here), effect, &mut own);
            own.extend(self.of_the_axis(about, &here, effect)?);
            Ok(Candidate {
                effect,
                law: None,
                columns: own,
            })
        };
        let candidates = candidates.iter().map(candidate).collect::<Result<_>>()?;
        Ok(Sensitivities {
            predicted,
            base,
            constants: at.constants.len(),
            candidates,
            near_edge,
            known: self.model.known.clone(),
        })
    }

    /// Fields of the rival, mm: what any change of stiffness beside the hole does elsewhere and, since no rig holds a specimen to a
    /// microradian, a rotation in the plane.
    fn rival(&self, (at, about): (&State, Option<&Anchor>)) -> Result<Vec<Vec<[f64; 2]>>> {
        let sight = self.few.sight();
        let mut fields = self
            .experiment
            .softened(about, at, sight, Softening::NearEdge)?;
        if !fields.is_empty() {
            let turned = |p: &[f64; 2]| [-ROTATION * p[1], ROTATION * p[0]];
            fields.push(sight.points().iter().map(turned).collect());
        }
        Ok(fields)
    }

    /// How many columns [`Linearised::sensitivities`] has for `candidates`: those of the model, and those of the candidates.
    pub fn columns(&self, candidates: &[&'static dyn Effect]) -> [usize; 2] {
        let own = |e: &&'static dyn Effect| e.parameters().len();
        [self.base().len(), candidates.iter().map(own).sum()]
    }

    /// What varies in every model: constants, thickness, load, declared effects.
    fn base(&self) -> Vec<Direction> {
        let constants = self.model.constants().len();
        let mut directions: Vec<Direction> = (0..constants).map(Direction::Constant).collect();
        if self.model.experiment().specimen.thickness_mm.sd > 0.0 {
            directions.push(Direction::Thickness);
        }
        if !self
            .model
            .effects
            .iter()
            .any(|e| e.name() == LOAD_SCALE.name())
        {
            // it cannot be told from a common factor of all moduli: it takes part in every model with its prior
            directions.push(Direction::Load);
        }
        // what the recording adds is corrected in the field, not fitted
        let declared = self.model.effects.iter();
        let fitted = declared.filter(|e| e.kind() != Kind::Recorded);
        directions.extend(fitted.flat_map(amplitudes));
        directions
    }

    /// Linearise the declared part anew at a state, keeping the candidates' columns.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn again(&self, at: &State, before: &Sensitivities) -> Result<Sensitivities> {
        let mut sensitivities = self.sensitivities(at, &[])?;
        let kept = before.candidates.iter().flat_map(|c| &c.columns);
        move_to_means(&mut sensitivities.predicted, kept);
        sensitivities.candidates = before.candidates.clone();
        sensitivities.near_edge = before.near_edge.clone();
        Ok(sensitivities)
    }

    pub(super) fn column(
        &self,
        (at, about): (&State, Option<&Anchor>),
        here: &Prediction,
        direction: Direction,
    ) -> Result<Column> {
        let (name, mean, sd, value, step) = match direction {
            Direction::Constant(k) => {
                let prior = self.model.marginals()[k];
                let step = CONSTANT_STEP * prior.mean.abs();
                let name = self.model.constants()[k].to_string();
                (name, prior.mean, prior.sd, at.constants[k], step)
            }
            Direction::Thickness => {
                let MeanSd { mean, sd } = self.model.experiment().specimen.thickness_mm;
                (THICKNESS.to_string(), mean, sd, at.thickness_mm, sd)
            }
            Direction::Load => {
                let sd = self.prior_sd(LOAD_SCALE, 0);
                (
                    amplitude_name(LOAD_SCALE, &LOAD_SCALE.parameters()[0]),
                    0.0,
                    sd,
                    0.0,
                    sd,
                )
            }
            Direction::Amplitude(effect, k) => {
                let sd = self.prior_sd(effect, k);
                let name = amplitude_name(effect, &effect.parameters()[k]);
                let value = at.amplitude(effect)[k];
                // of a lens without strength the centre does not matter: taken back with it, their product would be subtracted twice
                let mean = if effect.name() == LENS && k > 0 {
                    value
                } else {
                    0.0
                };
                (name, mean, sd, value, AMPLITUDE_STEP * sd)
            }
        };
        let slope = sensitivity(
            self.experiment,
            (at, about),
            here,
            self.few.sight(),
            direction,
            step,
        )?;
        Ok(Column {
            name,
            mean,
            sd,
            at: value,
            positive: matches!(direction, Direction::Amplitude(effect, k) if effect.parameters()[k].positive),
            product: false,
            values: self.few.average(&slope).map(|values| values * sd),
        })
    }

    /// Prior sd of an amplitude, border units.
    pub(super) fn prior_sd(&self, effect: &'static dyn Effect, k: usize) -> f64 {
        // only translations are free: their unit is the micrometre
        let free = FREE * self.size_mm * crate::quantity::UM_PER_MM;
        self.model.prior_sd(effect, k).unwrap_or(free)
    }
}

/// Carry a prediction from where columns were linearised to the prior means of their parameters.
fn move_to_means<'a>(predicted: &mut [DVector<f64>; 2], columns: impl Iterator<Item = &'a Column>) {
    for column in columns {
        let shift = (column.mean - column.at) / column.sd;
        for (sum, values) in predicted.iter_mut().zip(&column.values) {
            sum.axpy(shift, values, 1.0);
        }
    }
}
