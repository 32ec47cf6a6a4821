//! Closing the loop: identify, find what is left, trace it to an effect, add the effect, identify again.

use std::time::Instant;

use super::account::Account;
use super::attribute::attribute;
use super::averaged::Interval;
use super::axis::entail_strain;
use super::conclusion::{Conclusion, Status, conclude};
use super::extend::extended;
use super::quoted::Quoted;
use super::round::Round;
use super::tracing::Tracing;
use super::vetoes::{contradiction, surrogate};
use crate::error::{Blame, Result};
use crate::experiment::State;
use crate::files::Keyed;
use crate::identify::{Identification, Options, Prepared, identify, refine};
use crate::infer::Model;
use crate::progress::Progress;

/// All rounds and the conclusion.
pub struct Closed {
    /// Rounds, the first the model as it was given.
    pub rounds: Vec<Round>,
    /// The last model identified again with the unexplained structure as a correlated discrepancy, if some is left.
    pub with_discrepancy: Option<Identification>,
    pub conclusion: Conclusion,
    /// The posterior to quote, where it was sampled.
    pub sampled: Option<Quoted>,
}

impl Closed {
    /// The constants to quote: averaged over what may act unseen, or what spans all answers where the account is suspect.
    pub fn quoted(&self) -> Keyed<Interval> {
        match (&self.sampled, &self.conclusion.suspect) {
            (Some(sampled), Some(suspect)) => {
                let closed = suspect.answers.iter().map(|a| a.constants.clone());
                sampled.intervals(&closed.collect::<Vec<_>>())
            }
            (Some(sampled), None) => {
                let last = &self.rounds[self.rounds.len() - 1];
                sampled.intervals(std::slice::from_ref(&last.tracing.averaged))
            }
            (None, Some(suspect)) => suspect.hull(),
            (None, None) => self.rounds[self.rounds.len() - 1].tracing.averaged.clone(),
        }
    }
}

/// Run rounds until nothing more is accepted, at most `most` refits, none begun after the deadline. `options` gives each
/// attempt at a round its own. A later round that the deadline cuts off before there is anything to say of it does not count.
///
/// An added effect whose refit contradicts its tracing, or cannot be fitted at all, is taken out again and its residual traced anew
/// about the refit, once; then it is left undecided. The reduced model of the last round follows the posterior.
///
/// # Errors
/// Those of identifying and tracing the model as it was given.
pub fn close<'a>(
    model: &Model,
    most: usize,
    options: &dyn Fn(usize) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Closed> {
    let mut rounds: Vec<Round> = Vec::new();
    let mut doubts = Doubts::default();
    let mut next = Some(model.clone());
    let mut attempts = 0;
    while let Some(model) = next.take() {
        let attempt = attempts;
        attempts += 1;
        let options = options(attempt);
        let is_over = || options.deadline.is_some_and(|end| Instant::now() >= end);
        let found = identify(&model, &options, progress);
        match found.and_then(|found| doubts.round(model, attempt, found, progress)) {
            Ok(round) => rounds.push(round),
            Err(e) if rounds.is_empty() => return Err(e),
            Err(e) if e.blame() == Blame::Limit => break,
            Err(e) => {
                // the fit of what was called for: without it the loop goes on
                doubts.refuse(&rounds[rounds.len() - 1], e.to_string());
                next = doubts.again(&mut rounds, None, progress)?;
                continue;
            }
        }
        if is_over() {
            break;
        }
        next = next_model(&rounds[rounds.len() - 1]).filter(|_| rounds.len() <= most);
        if next.is_some() {
            continue;
        }
        if let Some((at, why)) = contradicted(&rounds) {
            let last = rounds.split_off(at + 1).pop();
            doubts.refuse(&rounds[at], why);
            next = doubts
                .again(&mut rounds, last.as_ref(), progress)?
                .filter(|_| rounds.len() <= most);
        }
    }
    let last = rounds.last_mut();
    if last.is_some_and(|round| follow(round, attempts, options(attempts), progress)) {
        attempts += 1;
    }
    let conclusion = conclude(&rounds, &doubts.refused);
    let with_discrepancy = with_discrepancy(&rounds, &conclusion, options(attempts), progress);
    Ok(Closed {
        rounds,
        with_discrepancy,
        conclusion,
        sampled: None,
    })
}

/// The round whose effect does not hold once all others are in the model, and why.
fn contradicted(rounds: &[Round]) -> Option<(usize, String)> {
    let last = rounds.last()?;
    let mut called = rounds[..rounds.len() - 1].iter().enumerate();
    called
        .find_map(|(k, round)| Some((k, contradiction(round, &last.model, &last.identification)?)))
}

/// Effects that were added and taken out again.
#[derive(Default)]
struct Doubts {
    /// Effect and reason, once for each time.
    refused: Vec<(&'static str, String)>,
}

/// An effect that is refused so often is not traced any more.
const REFUSALS: usize = 2;

impl Doubts {
    /// Note why what a round called for did not hold.
    fn refuse(&mut self, round: &Round, why: String) {
        self.refused
            .extend(round.tracing.accepted.map(|e| (e.name(), why)));
    }

    /// What an identification leaves, traced.
    fn round(
        &self,
        model: Model,
        attempt: usize,
        identification: Identification,
        progress: &dyn Progress,
    ) -> Result<Round> {
        let start = start(&model, &identification);
        let (tracing, account) =
            self.attribute(&model, &identification.inverse.prepared, start, progress)?;
        identification.inverse.prepared.problem.experiment.rest();
        Ok(Round {
            model,
            attempt,
            identification,
            tracing,
            account,
        })
    }

    /// Trace the last of some rounds anew, about the refit that was refused where there is one; the model that it calls for now.
    fn again(
        &self,
        rounds: &mut [Round],
        refit: Option<&Round>,
        progress: &dyn Progress,
    ) -> Result<Option<Model>> {
        let Some(round) = rounds.last_mut() else {
            return Ok(None);
        };
        let about = refit.unwrap_or(round);
        let start = start(&about.model, &about.identification);
        let prepared = &round.identification.inverse.prepared;
        (round.tracing, round.account) = self.attribute(&round.model, prepared, start, progress)?;
        Ok(next_model(round))
    }

    /// Trace a residual to the effects that have not been refused for good; those are undecided.
    fn attribute(
        &self,
        model: &Model,
        prepared: &Prepared,
        start: State,
        progress: &dyn Progress,
    ) -> Result<(Tracing, Account)> {
        let count = |name: &str| self.refused.iter().filter(|(n, _)| *n == name).count();
        let left = |name: &str| count(name) < REFUSALS;
        let (mut tracing, account) = attribute(model, prepared, start, &left, progress)?;
        for (name, why) in &self.refused {
            let known = tracing.left_out.iter().any(|(n, _)| n == name);
            if !left(name) && !known {
                tracing
                    .left_out
                    .push((name, format!("added and taken out again: {why}")));
                tracing.undecided.push(vec![name]);
            }
        }
        Ok((tracing, account))
    }
}

/// Where tracing starts: at the posterior means, or at the prior means where constants are not determined, because the ridge's steps from
/// there are too short to come back from absurd ones.
fn start(model: &Model, identification: &Identification) -> State {
    let moments = |name: &str| identification.moments(name).map(|(mean, _)| mean);
    let mut state = model.state(&moments);
    let far = model.marginals().into_iter().zip(&state.constants);
    if far
        .into_iter()
        .any(|(m, x)| (x - m.mean).abs() > FAR * m.sd)
    {
        state.constants = model.state(&|_| None).constants;
    }
    state
}

/// Constants that lie farther from their prior means, prior sds, are no start for tracing.
const FAR: f64 = 2.5;

/// The model that a round's tracing calls for.
fn next_model(round: &Round) -> Option<Model> {
    let Tracing {
        accepted,
        accepted_amplitude,
        accepted_law,
        averaged,
        series,
        ..
    } = &round.tracing;
    let effect = (*accepted)?;
    let mut model = extended(&round.model, effect, accepted_amplitude, averaged);
    if series.is_none() {
        entail_strain(&mut model, effect, accepted_amplitude);
    }
    if let Some(traced) = series {
        let sizes = traced.plausible.iter().cloned();
        model.experiment_mut().plausible.extend(sizes);
    }
    model.traced.clone_from(series);
    if let Some(law) = accepted_law {
        let laws = &mut model.experiment_mut().laws;
        laws.insert(effect.name().to_string(), *law);
    }
    Some(model)
}

/// Let the reduced model of the last round follow its posterior where the finite elements ask for it, as another attempt; whether it did.
/// One that cannot, or not in time, leaves the round as it is, and the verdict says of the reduced model what it is worth.
fn follow(
    round: &mut Round,
    attempt: usize,
    options: Options<'_>,
    progress: &dyn Progress,
) -> bool {
    let found = &round.identification;
    let is_over = options.deadline.is_some_and(|end| Instant::now() >= end);
    if is_over || !found.determined || surrogate(found).is_none() {
        return false;
    }
    let options = Options {
        refinements: options.refinements.max(REFINEMENTS),
        ..options
    };
    let Ok(Some(refined)) = refine(&round.model, found, &options, progress) else {
        return false;
    };
    round.identification = refined;
    round.attempt = attempt;
    true
}

/// Refinements of the last round's reduced model, at most.
const REFINEMENTS: usize = 3;

/// The last model with the structure that is left as a discrepancy, where some is left and the time allows it.
fn with_discrepancy(
    rounds: &[Round],
    conclusion: &Conclusion,
    options: Options<'_>,
    progress: &dyn Progress,
) -> Option<Identification> {
    let last = &rounds[rounds.len() - 1];
    let structure = last.tracing.structure;
    let options = Options {
        discrepancy: structure,
        ..options
    };
    let wanted = conclusion.status == Status::Unexplained && structure.iter().any(Option::is_some);
    let over = options.deadline.is_some_and(|end| Instant::now() >= end);
    // the loop has ended without it: where it cannot be identified, nothing is lost
    (wanted && !over).then(|| identify(&last.model, &options, progress).ok())?
}
