//! The point about which a test is linearised.

use rayon::prelude::*;

use super::column::{Column, StepStack};
use super::forward::Forward;
use super::observing::{ObservedAbout, quotient};
use crate::effect::{Scene, amplitude_name};
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{Direction, Softening};
use crate::infer::{Amplitude, EffectUnderLaw};
use crate::laminate::MeanSd;
use crate::reduce::THICKNESS;

/// A test's forward model about a state.
pub struct Linearisation<'a> {
    pub(super) forward: &'a Forward<'a>,
    pub(super) observed: Box<dyn ObservedAbout + 'a>,
    pub(super) at: &'a SeriesState,
}

/// Steps of central differences: of a constant over its value, of an amplitude in prior sds, the width's in percent.
const CONSTANT_STEP: f64 = 0.01;
const AMPLITUDE_STEP: f64 = 0.5;
const WIDTH_STEP_PERCENT: f64 = 0.2;

/// Power of 1 / width with which fields beside a hole go (1.34 of steel, 1.39 of a laminate with a third of the width drilled out).
const WIDTH_POWER: f64 = 1.3;

impl Linearisation<'_> {
    pub(super) fn scene(&self) -> &Scene {
        self.forward.observing.experiment().scene()
    }

    /// What all steps show, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn predicted(&self) -> Result<StepStack> {
        self.observed.predicted()
    }

    /// What changes of the stiffness do.
    ///
    /// # Errors
    /// Those of [`crate::experiment::Mechanics::softened`].
    pub fn softened(&self, softening: Softening<'_>) -> Result<Vec<StepStack>> {
        self.observed.softened(softening)
    }

    /// What varies in every model: constants, thickness, load, what is every step's own.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn always(&self) -> Result<Vec<Column>> {
        let model = self.forward.model;
        let names = model.constants();
        let constants = names.par_iter().zip(model.marginals()).enumerate();
        let mut columns: Vec<Column> = constants
            .map(|(k, (name, prior))| {
                let step = CONSTANT_STEP * prior.mean.abs();
                let slope = self.slope(Direction::Constant(k), &[], step)?;
                let at = self.at.shared.constants[k];
                Ok(Column::new(
                    (*name).into(),
                    [prior.mean, prior.sd],
                    at,
                    slope,
                ))
            })
            .collect::<Result<_>>()?;
        let MeanSd { mean, sd } = model.experiment().specimen.thickness_mm;
        if sd > 0.0 {
            let slope = self.slope(Direction::Thickness, &[], sd)?;
            let at = self.at.shared.thickness_mm;
            columns.push(Column::new(THICKNESS.into(), [mean, sd], at, slope));
        }
        for (effect, sd) in self.forward.of_every_test() {
            let slope = match (effect.is_force_scale(), self.forward.solves_width) {
                (true, _) => self.slope(Direction::Load, &[], sd)?,
                (false, true) => {
                    self.slope(Direction::Amplitude(effect, 0), &[], WIDTH_STEP_PERCENT)?
                }
                (false, false) => self
                    .slope(Direction::Load, &[], sd)?
                    .map(|u| u * -WIDTH_POWER),
            };
            let name = amplitude_name(effect, &effect.parameters()[0]);
            columns.push(Column::new(name, [0.0, sd], 0.0, slope));
        }
        columns.extend(self.observed.of_steps());
        Ok(columns)
    }

    fn slope(&self, direction: Direction, weights: &[f64], step: f64) -> Result<StepStack> {
        (self.forward.step)();
        self.observed.slope(direction, weights, step)
    }

    /// An effect's amplitudes over the steps.
    pub(super) fn amplitudes_of(&self, effect: &EffectUnderLaw) -> Vec<Amplitude> {
        effect.amplitudes(&self.at.loads, self.forward.observing.names())
    }

    /// The columns of an effect's amplitudes.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn amplitudes(&self, effect: &EffectUnderLaw) -> Result<Vec<Column>> {
        let column = |amplitude: Amplitude| {
            let Amplitude {
                name,
                parameter: k,
                weights,
            } = amplitude;
            let sd = self.forward.prior_sd(effect, k);
            let direction = Direction::Amplitude(effect.effect, k);
            let slope = self.slope(direction, &weights, AMPLITUDE_STEP * sd)?;
            let at = self.at.amplitude(effect.effect, &weights)[k];
            // of a lens without strength the centre does not matter: taken back with it, their product would be subtracted twice, which
            // under a specimen's motion is micrometres
            let mean = if effect.effect.is_centre(k) { at } else { 0.0 };
            let mut column = Column::new(name, [mean, sd], at, slope);
            column.positive = effect.effect.parameters()[k].positive;
            Ok(column)
        };
        self.amplitudes_of(effect).into_iter().map(column).collect()
    }

    /// The columns of an effect: its amplitudes', then their products with what is not known of the camera and of the pivot.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn columns(&self, effect: &EffectUnderLaw) -> Result<Vec<Column>> {
        let mut columns = self.amplitudes(effect)?;
        self.add_unknown_places(effect, &mut columns)?;
        Ok(columns)
    }

    /// What the camera of a scene reports more of one state than of another, over `over`, where both differ from this one by the picture or
    /// the motion alone.
    pub(super) fn pictured(
        &self,
        states: [&SeriesState; 2],
        over: f64,
        scene: &Scene,
    ) -> StepStack {
        let reported = states.map(|state| self.observed.reported(state, scene));
        quotient(reported, over)
    }
}
