//! Closing the loop over a study: each experiment's effects are weighed with what all others say of the constants, the experiment first in
//! which an effect has the most evidence, so that it corrects what the others are told.

use std::sync::Arc;

use super::together::{Alone, likelihood_beyond_prior, others};
use super::{Disagreement, Observed, Study, Undeclared, WORTH};
use crate::error::Result;
use crate::identify::Options;
use crate::infer::{ConstantsLikelihood, Marginal, Model, Moments};
use crate::progress::Progress;
use crate::trace::{self, Closed, LoopStage, Round};

/// A field of which the loop is closed.
pub struct ClosedField {
    /// Its place among the experiments.
    pub place: usize,
    pub closed: Closed,
}

/// What a loop over all experiments found.
pub struct ClosedStudy {
    /// The study with all effects that were declared on the way.
    pub study: Study,
    /// In the order of the experiments.
    pub fields: Vec<ClosedField>,
    /// Effects that were declared in experiments that are no field.
    pub declared: Vec<(String, Undeclared)>,
    /// The experiments as they were given, and with what was found.
    pub before: Disagreement,
    pub after: Disagreement,
}

/// What a loop over a study samples of an experiment.
#[derive(Debug, Clone, Copy)]
pub enum StudyStage {
    /// A field that is traced without adding to it, to know where to begin.
    Ordering,
    /// A field in its own loop.
    Field(LoopStage),
    /// An experiment that is no field, with an effect declared.
    Extended,
}

/// How a stage of an experiment is run.
pub type StageOptions<'a, 'o> = &'a dyn Fn(&str, StudyStage) -> Options<'o>;

struct LoopState<'a, 'o> {
    study: Study,
    alone: Vec<Alone>,
    priors: Vec<Marginal>,
    options: StageOptions<'a, 'o>,
    progress: &'a dyn Progress,
    declared: Vec<(String, Undeclared)>,
}

/// Close the loop over all experiments of a study, with at most `most` effects in each field.
///
/// # Errors
/// Those of identifying and tracing the fields as they were given.
pub fn close<'o>(
    study: &Study,
    alone: Vec<Alone>,
    (most, options): (usize, StageOptions<'_, 'o>),
    progress: &dyn Progress,
) -> Result<ClosedStudy> {
    let priors = study.shared().priors();
    let mut state = LoopState {
        study: study.clone(),
        alone,
        priors,
        options,
        progress,
        declared: Vec::new(),
    };
    let before = state.together();
    let mut fields = Vec::new();
    for k in state.order()? {
        match state.model(k) {
            Some(model) => {
                let stage = |stage| options(&state.alone[k].name, StudyStage::Field(stage));
                let closed = trace::close(&model, most, &stage, progress)?;
                state.learn(k, closed.rounds.last())?;
                fields.push(ClosedField { place: k, closed });
            }
            None => state.declare(k)?,
        }
    }
    fields.sort_by_key(|f| f.place);
    let after = state.together();
    Ok(ClosedStudy {
        study: state.study,
        fields,
        declared: state.declared,
        before,
        after,
    })
}

impl LoopState<'_, '_> {
    fn together(&self) -> Disagreement {
        let said: Vec<&ConstantsLikelihood> = self.alone.iter().map(|a| &a.said).collect();
        let moments = |a: &Alone| (a.name.clone(), a.moments.clone());
        let alone = self.alone.iter().map(moments).collect();
        let mut together =
            Disagreement::new(alone, &said, (&self.priors, &self.study.shared().moduli()));
        for sampled in self.alone.iter().filter_map(|a| a.sampled.as_ref()) {
            together.sections.extend(sampled.sections.iter().cloned());
            together.warnings.extend(sampled.warnings.iter().cloned());
        }
        together
    }

    /// What all others say of the constants; of a common factor of the moduli only those whose specimen and load cell are others.
    fn others(&self, k: usize) -> Option<ConstantsLikelihood> {
        let own = self.study.experiments[k].owners();
        let moduli = self.study.shared().moduli();
        let one = |(e, alone): (usize, &Alone)| {
            let mut owners = self.study.experiments[e].owners().into_iter();
            match owners.any(|o| own.contains(&o)) {
                true => alone.said.without_common_factor(&moduli),
                false => alone.said.clone(),
            }
        };
        let said: Vec<ConstantsLikelihood> = self.alone.iter().enumerate().map(one).collect();
        others(&said.iter().collect::<Vec<_>>(), Some(k))
    }

    /// The model of a field, with what all others say of the material.
    fn model(&self, k: usize) -> Option<Model> {
        let model = self.study.experiments[k].field()?;
        Some(Model {
            known: self.others(k).map(Arc::new),
            ..model.clone()
        })
    }

    /// The strongest effect that an experiment that is no field can declare.
    fn strongest(&self, k: usize) -> Option<Undeclared> {
        let others = self.others(k);
        let observed: &dyn Observed = &*self.alone[k].observed;
        let mean = self.alone[k].sampled.as_ref()?.verdict.rows.iter();
        let mean: Vec<f64> = mean.map(|row| row.mean).collect();
        let all = observed.undeclared(&mean, others.as_ref()).into_iter();
        let declarable = |u: &Undeclared| self.study.experiments[k].with_effect(u.name).is_some();
        all.filter(declarable)
            .max_by(|a, b| a.log_bayes_factor.total_cmp(&b.log_bayes_factor))
    }

    /// The experiments in which effects can be declared, that with the most evidence for one first.
    fn order(&self) -> Result<Vec<usize>> {
        let all = 0..self.alone.len();
        let fields: Vec<usize> = all
            .clone()
            .filter(|k| self.study.experiments[*k].field().is_some())
            .collect();
        let others: Vec<(f64, usize)> = all
            .filter_map(|k| Some((self.strongest(k)?.log_bayes_factor, k)))
            .collect();
        if fields.len() == 1 && others.is_empty() {
            return Ok(fields);
        }
        let mut strengths = others;
        for k in fields {
            strengths.push((self.strength(k)?, k));
        }
        strengths.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(strengths.into_iter().map(|(_, k)| k).collect())
    }

    /// Log Bayes factor of the effect that a field calls for, given what all others say.
    fn strength(&self, k: usize) -> Result<f64> {
        let Some(model) = self.model(k) else {
            return Ok(f64::NEG_INFINITY);
        };
        let options = |_| (self.options)(&self.alone[k].name, StudyStage::Ordering);
        let traced = trace::explain(&model, 0, &options, self.progress)?;
        let tracing = traced.rounds.last().map(|round| &round.tracing);
        let called = tracing.and_then(|t| t.accepted.as_ref().map(|a| (t, a.effect.name())));
        let group = called.and_then(|(t, name)| t.groups.iter().find(|g| g.leader == name));
        Ok(group.map_or(f64::NEG_INFINITY, |g| g.log_bayes_factor))
    }

    /// Take over what a field says with the effects that were found in it.
    fn learn(&mut self, k: usize, last: Option<&Round>) -> Result<()> {
        if let Some(moments) = last.and_then(trace::field_alone) {
            self.say(k, moments)?;
        }
        if let Some(round) = last {
            let model = Model {
                known: None,
                ..round.model.clone()
            };
            self.study = self.study.with_field(k, model);
        }
        Ok(())
    }

    fn say(&mut self, k: usize, moments: Moments) -> Result<()> {
        self.alone[k].said = likelihood_beyond_prior(&moments, &self.priors)?;
        self.alone[k].moments = moments;
        Ok(())
    }

    /// Declare what has the evidence in an experiment that is no field, and identify from it again.
    fn declare(&mut self, k: usize) -> Result<()> {
        let strongest = self.strongest(k);
        let Some(effect) = strongest.filter(|u| u.log_bayes_factor > WORTH) else {
            return Ok(());
        };
        let Some(experiment) = self.study.experiments[k].with_effect(effect.name) else {
            return Ok(());
        };
        let options = (self.options)(&self.alone[k].name, StudyStage::Extended);
        let shared = self.study.shared();
        let observed = experiment.observed(&shared, &options, self.progress)?;
        let name = self.alone[k].name.clone();
        self.alone[k] = Alone::new(&name, observed, (&shared, &options), self.progress)?;
        self.study = self.study.with(k, experiment);
        self.declared.push((name, effect));
        Ok(())
    }
}
