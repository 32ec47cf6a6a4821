//! The forward model of a test, ready to be linearised.

use rayon::prelude::*;

use super::column::{Column, StepStack};
use super::linearisation::Linearisation;
use super::observing::Observing;
use super::sensitivities::{Candidate, Sensitivities};
use crate::effect::Kind;
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{Softening, State};
use crate::infer::{EffectUnderLaw, Model};

/// A test's model with how it is observed.
pub struct Forward<'a> {
    pub model: &'a Model,
    pub observing: Box<dyn Observing + 'a>,
    /// Called for every sensitivity.
    pub step: &'a (dyn Fn() + Sync),
}

impl Forward<'_> {
    /// What all steps show at a state, mm.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn shown(&self, at: &SeriesState) -> Result<StepStack> {
        self.observing.shown(at)
    }

    /// Linearise about a state.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn about<'a>(&'a self, at: &'a SeriesState) -> Result<Linearisation<'a>> {
        Ok(Linearisation {
            forward: self,
            observed: self.observing.about(at)?,
            at,
        })
    }

    /// Prior sd of an amplitude, border units.
    pub fn prior_sd(&self, effect: &EffectUnderLaw, k: usize) -> f64 {
        self.observing.prior_sd(self.model, effect.effect, k)
    }

    /// Whether an effect takes part beside what every step has of its own; what the recording adds is corrected in the field, not fitted.
    pub fn takes_part(&self, effect: &EffectUnderLaw) -> bool {
        let moves = effect.effect.is_rigid();
        effect.effect.kind() != Kind::Recorded && !(moves && self.observing.of_each_step())
    }

    /// Effects of the model that the linearised prediction varies.
    pub fn declared(&self) -> Vec<EffectUnderLaw> {
        let under_law = |&effect| match self.observing.of_each_step() {
            true => self.model.under_law(effect),
            false => EffectUnderLaw { effect, law: None },
        };
        let effects = self.model.effects.iter().map(under_law);
        effects.filter(|e| self.takes_part(e)).collect()
    }

    /// Where a linearisation begins: at the constants and declared effects of a state, with every step's own motions at rest.
    pub fn beginning(&self, mut shared: State) -> SeriesState {
        for moving in self.declared().iter().filter(|e| e.law.is_some()) {
            let none = vec![0.0; moving.effect.parameters().len()];
            shared.set(moving.effect, none);
        }
        self.observing.beginning(shared)
    }

    /// Whether the load's scale takes part beside the declared effects: it cannot be told from a common factor of all moduli, and does so
    /// with its prior.
    pub(super) fn scales_the_load(&self) -> bool {
        let mut effects = self.model.effects.iter();
        !effects.any(|e| e.is_force_scale())
    }

    /// Amplitudes of some effects: how often [`Forward::sensitivities`] calls the step for them.
    pub fn count(&self, effects: &[EffectUnderLaw], at: &SeriesState) -> usize {
        let names = self.observing.names();
        let amplitudes = effects.iter().map(|e| e.amplitudes(&at.loads, names).len());
        amplitudes.sum()
    }

    /// Linearise about a state, with all columns of the model and of candidates.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn sensitivities(
        &self,
        at: &SeriesState,
        declared: &[EffectUnderLaw],
        candidates: &[EffectUnderLaw],
    ) -> Result<Sensitivities> {
        let here = self.about(at)?;
        let mut base = here.always()?;
        let own: Vec<Vec<Column>> = declared
            .par_iter()
            .map(|effect| match self.observing.of_each_step() {
                true => here.columns(effect),
                // one field does not tell the places: the strain that they leave is declared beside a rotation that was found
                false => here.amplitudes(effect),
            })
            .collect::<Result<_>>()?;
        base.extend(own.into_iter().flatten());
        let candidates: Vec<Candidate> = candidates
            .par_iter()
            .map(|effect| {
                Ok(Candidate {
                    effect: effect.effect,
                    law: effect.law,
                    columns: here.columns(effect)?,
                })
            })
            .collect::<Result<_>>()?;
        let near_edge = match candidates.is_empty() {
            true => Vec::new(),
            false => here.softened(Softening::NearEdge)?,
        };
        let mut sensitivities = Sensitivities {
            predicted: here.predicted()?,
            base,
            constants: at.shared.constants.len(),
            candidates,
            near_edge,
            known: self.model.known.clone(),
        };
        sensitivities.carry_to_means();
        Ok(sensitivities)
    }

    /// Linearise the declared part anew at a state, keeping the candidates' columns.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub(super) fn again(
        &self,
        at: &SeriesState,
        declared: &[EffectUnderLaw],
        before: Sensitivities,
    ) -> Result<Sensitivities> {
        let mut sensitivities = self.sensitivities(at, declared, &[])?;
        sensitivities.candidates = before.candidates;
        sensitivities.near_edge = before.near_edge;
        sensitivities.carry_candidates();
        Ok(sensitivities)
    }
}
