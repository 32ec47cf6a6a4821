//! The test linearised about a point: what the data leave of the prediction there, and what a change of every
//! constant and of every effect's amplitude does to it, as block averages.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::effect::{Effect, Kind, LOAD_SCALE, amplitude_name};
use crate::error::Result;
use crate::experiment::{Direction, Prediction, State, predict_with_gradient, sensitivity};
use crate::field::Blocks;
use crate::identify::Prepared;
use crate::infer::Model;
use crate::laminate::MeanSd;
use crate::noise::NormalEquations;
use crate::reduce::THICKNESS;

/// One parameter and what it does.
#[derive(Debug, Clone)]
pub struct Column {
    /// `E1_GPa`, `thickness_mm`, `load_misalignment.angle_deg`.
    pub name: String,
    /// Prior mean, border units.
    pub mean: f64,
    /// Prior sd, border units.
    pub sd: f64,
    /// Value at which the test was linearised.
    pub at: f64,
    /// Change of the block averages of (u1, u2) for one prior sd, mm.
    pub values: [DVector<f64>; 2],
}

/// An effect that the model lacks, or might.
#[derive(Clone)]
pub struct Candidate {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Its parameters.
    pub columns: Vec<Column>,
}

/// Data and sensitivities.
#[derive(Clone)]
pub struct Sensitivities {
    /// Measured minus predicted at the prior means of all parameters, by the sensitivities: block averages of (u1, u2), mm.
    pub rest: [DVector<f64>; 2],
    /// Elastic constants, the thickness if it is uncertain, the load's scale, declared effects.
    pub base: Vec<Column>,
    /// How many of `base` are elastic constants.
    pub constants: usize,
    /// Effects that are not declared.
    pub candidates: Vec<Candidate>,
}

impl Sensitivities {
    /// Mean of all parameters, in prior sds from their means, with every candidate present at its prior and noise that
    /// is white: of the size that is left, on blocks of `count` points.
    pub fn ridge(&self, count: &[usize]) -> DVector<f64> {
        let columns: Vec<&Column> = self
            .base
            .iter()
            .chain(self.candidates.iter().flat_map(|c| &c.columns))
            .collect();
        let p = columns.len();
        let mut gram = DMatrix::zeros(p, p);
        let mut right = DVector::zeros(p);
        let mut total = 0.0;
        for c in 0..2 {
            let mut weighted = DMatrix::zeros(count.len(), p + 1);
            for (b, &n) in count.iter().enumerate() {
                let root = (n as f64).sqrt();
                for (k, column) in columns.iter().enumerate() {
                    weighted[(b, k)] = root * column.values[c][b];
                }
                weighted[(b, p)] = root * self.rest[c][b];
            }
            let all = weighted.tr_mul(&weighted);
            gram += all.view((0, 0), (p, p));
            right += all.view((0, p), (p, 1)).column(0);
            total += all[(p, p)];
        }
        let solve = |variance: f64| {
            NormalEquations::with_unit_prior(gram.clone() / variance, &right / variance)
                .map_or_else(|| DVector::zeros(p), |f| f.mean())
        };
        // the white variance of a point from what a nearly free fit leaves
        let nearly_free = solve(1e-12 * total.max(f64::MIN_POSITIVE));
        let left = total - 2.0 * right.dot(&nearly_free) + nearly_free.dot(&(&gram * &nearly_free));
        let freedom = (2 * count.len()).saturating_sub(p).max(1) as f64;
        solve((left / freedom).max(1e-12 * total))
    }
}

/// The test that is linearised.
pub struct Linearised<'a> {
    /// The model.
    pub model: &'a Model,
    /// Plate and measured points.
    pub prepared: &'a Prepared,
    /// Measured displacements at the points, corrected for miscounted fringes, mm.
    pub measured: &'a [[f64; 2]],
    /// Block averages' geometry.
    pub blocks: &'a Blocks,
    /// Called after each column.
    pub step: &'a (dyn Fn() + Sync),
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
        let experiment = &*self.prepared.problem.experiment;
        let here = predict_with_gradient(experiment, at, &self.prepared.observation.sight)?;
        let mut directions = self.base();
        let declared = directions.len();
        directions.extend(candidates.iter().flat_map(amplitudes));
        let columns: Vec<Column> = directions
            .par_iter()
            .map(|&direction| {
                let column = self.column(at, &here, direction);
                (self.step)();
                column
            })
            .collect::<Result<_>>()?;
        let residual: Vec<[f64; 2]> = self
            .measured
            .iter()
            .zip(&here.field)
            .map(|(m, f)| [m[0] - f[0], m[1] - f[1]])
            .collect();
        let mut rest = self.average(&residual);
        for column in &columns {
            let shift = (column.mean - column.at) / column.sd;
            for (rest, values) in rest.iter_mut().zip(&column.values) {
                rest.axpy(-shift, values, 1.0);
            }
        }
        let mut columns = columns.into_iter();
        let base = columns.by_ref().take(declared).collect();
        let candidates = candidates
            .iter()
            .map(|&effect| Candidate {
                effect,
                columns: columns.by_ref().take(effect.parameters().len()).collect(),
            })
            .collect();
        Ok(Sensitivities {
            rest,
            base,
            constants: at.constants.len(),
            candidates,
        })
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
        for column in before.candidates.iter().flat_map(|c| &c.columns) {
            let shift = (column.mean - column.at) / column.sd;
            for (rest, values) in sensitivities.rest.iter_mut().zip(&column.values) {
                rest.axpy(-shift, values, 1.0);
            }
        }
        sensitivities.candidates = before.candidates.clone();
        Ok(sensitivities)
    }

    fn column(&self, at: &State, here: &Prediction, direction: Direction) -> Result<Column> {
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
                (name, 0.0, sd, at.amplitude(effect)[k], AMPLITUDE_STEP * sd)
            }
        };
        let Prepared {
            problem,
            observation,
            ..
        } = self.prepared;
        let slope = sensitivity(
            &*problem.experiment,
            at,
            here,
            &observation.sight,
            direction,
            step,
        )?;
        Ok(Column {
            name,
            mean,
            sd,
            at: value,
            values: self.average(&slope).map(|values| values * sd),
        })
    }

    /// Prior sd of an amplitude, border units.
    fn prior_sd(&self, effect: &'static dyn Effect, k: usize) -> f64 {
        self.model.prior_sd(effect, k).unwrap_or_else(|| {
            // only translations are free: their unit is the micrometre
            let field = self.measured;
            let square: f64 = field.iter().flatten().map(|u| u * u).sum();
            FREE * (square / field.len().max(1) as f64).sqrt() * crate::quantity::UM_PER_MM
        })
    }

    fn average(&self, field: &[[f64; 2]]) -> [DVector<f64>; 2] {
        [0, 1].map(|c| {
            let values: Vec<f64> = field.iter().map(|u| u[c]).collect();
            self.blocks.average(&values)
        })
    }
}
