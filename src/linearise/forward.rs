//! The forward model of a test, ready to be linearised.

use rayon::prelude::*;

use super::column::{Column, StepStack};
use super::exported;
use super::linearisation::Linearisation;
use super::observing::Observing;
use super::sensitivities::{Candidate, Sensitivities};
use crate::effect::{EFFECTS, Effect, Kind, why_not};
use crate::error::Result;
use crate::experiment::series::SeriesState;
use crate::experiment::{Softening, State};
use crate::infer::{EffectUnderLaw, Model};

/// Where columns of candidates come from.
#[derive(Clone, Copy)]
pub enum CandidateColumns<'a> {
    /// From the point about which all is linearised.
    Here,
    /// From the same point in another forward model of the test, on a coarser mesh.
    On(&'a Forward<'a>),
    /// From another point: those of the same candidates there, in the same order. Later ones, and those of effects that have moved since, are
    /// taken anew.
    Kept {
        of: &'a Sensitivities,
        moved: &'a [&'static str],
    },
}

impl<'a> CandidateColumns<'a> {
    /// Those of the k-th candidate, if they are kept.
    fn kept(self, k: usize, effect: &EffectUnderLaw) -> Option<&'a Candidate> {
        match self {
            Self::Kept { of, moved } if !moved.contains(&effect.effect.name()) => {
                of.candidates.get(k)
            }
            _ => None,
        }
    }
}

/// A test's model with how it is observed.
pub struct Forward<'a> {
    pub model: &'a Model,
    pub observing: Box<dyn Observing + 'a>,
    /// Whether another width is solved for. Elsewhere its column is a multiple of the load's: for its changes with the constants, and for plans and
    /// first looks, which then take the two for one.
    pub solves_width: bool,
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

    /// Columns of the shifts of a wave that acts in a state of a series: along both axes of the data in the first step, then in the others.
    ///
    /// # Errors
    /// Those of a finite-element solution.
    pub fn phases(&self, at: &SeriesState) -> Result<Vec<Column>> {
        let mut at = at.clone();
        let wave = exported::acting(&at, self.observing.experiment().scene()).next();
        if wave.is_none() || !self.observing.of_each_step() {
            return Ok(Vec::new());
        }
        at.shifts.resize(at.loads.len(), [0.0; 2]);
        let mut columns = self.observing.about(&at)?.of_steps();
        columns.retain(Column::is_phase);
        Ok(columns)
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
        for moving in self.declared().iter().filter(|e| e.varies()) {
            let none = vec![0.0; moving.effect.parameters().len()];
            shared.set(moving.effect, none);
        }
        self.observing.beginning(shared)
    }

    /// What takes part in every test that does not declare it, with its prior sd.
    pub(super) fn of_every_test(&self) -> Vec<(&'static dyn Effect, f64)> {
        let scene = self.observing.experiment().scene();
        let declares = |e: &dyn Effect| self.model.effects.iter().any(|d| d.name() == e.name());
        let all = EFFECTS.iter().copied().filter(|e| e.is_of_every_test());
        let open = all.filter(|e| !declares(*e) && why_not(*e, scene).is_none());
        let sized = open.map(|e| (e, self.observing.prior_sd(self.model, e, 0)));
        sized.filter(|(_, sd)| *sd > 0.0).collect()
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
        self.sensitivities_with(at, declared, candidates, CandidateColumns::Here)
    }

    /// The same with candidates' columns from elsewhere.
    ///
    /// # Errors
    /// Those of [`Forward::sensitivities`].
    pub fn sensitivities_with(
        &self,
        at: &SeriesState,
        declared: &[EffectUnderLaw],
        candidates: &[EffectUnderLaw],
        columns: CandidateColumns<'_>,
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
        let elsewhere = match columns {
            CandidateColumns::On(forward) if !candidates.is_empty() => Some(forward.about(at)?),
            _ => None,
        };
        let there = elsewhere.as_ref().unwrap_or(&here);
        let candidate = |(k, effect): (usize, &EffectUnderLaw)| {
            if let Some(kept) = columns.kept(k, effect) {
                return Ok(kept.clone());
            }
            Ok(Candidate {
                effect: effect.effect,
                law: effect.law,
                columns: there.columns(effect)?,
                scatters: self.model.always_acts(effect.effect),
            })
        };
        let all = candidates.par_iter().enumerate().map(candidate);
        let candidates: Vec<Candidate> = all.collect::<Result<_>>()?;
        // stresses beside the hole act in elements: of another mesh they are others
        let near_edge = match columns {
            CandidateColumns::Kept { of, .. } => of.near_edge.clone(),
            _ if candidates.is_empty() => Vec::new(),
            _ => here.softened(Softening::NearEdge)?,
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
