//! Closing the loop: identify, find what is left, trace it to an effect, add the effect, identify again; then conclude, and sample the
//! posterior to quote.
//!
//! The loop is a list of steps, each of which takes a value and returns the next:
//!
//! | step | from | to |
//! |---|---|---|
//! | [`Loop::turn`], until nothing is called for | a [`Course`] and a model | a [`NextStep`] |
//! | [`Loop::with_undecided`] | the rounds | the rounds, the last held against what is undecided too |
//! | [`conclude`] | the rounds | the [`Conclusion`] |
//! | [`quote`] | both | the posterior [`ToQuote`] |

use std::time::Instant;

use super::attribute::attribute_kept;
use super::averaged::Interval;
use super::conclusion::{Conclusion, conclude};
use super::extend::extended;
use super::quoted::{Quoted, Scenario, quote};
use super::refused::Refused;
use super::round::Round;
use super::traced::LinearisedEvidence;
use super::tracing::{Accepted, Tracing};
use super::vetoes::refuted;
use crate::effect::Kind;
use crate::error::{Blame, Error, Result};
use crate::experiment::series::{Law, SeriesState};
use crate::files::Keyed;
use crate::identify::{Begun, Identification, InverseProblem, Options, identify_from};
use crate::infer::{EffectUnderLaw, Model};
use crate::progress::Progress;

/// What a loop samples: each has chains and a checkpoint of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopStage {
    /// An attempt at a round, by its number; some are taken back.
    Attempt(usize),
    /// An answer of the posterior to quote.
    Answer(Scenario),
}

/// The rounds of a loop and what they come to.
pub struct Explained {
    /// Rounds, the first the model as it was given.
    pub rounds: Vec<Round>,
    pub conclusion: Conclusion,
}

/// A loop that has come to its end.
pub struct Closed {
    /// Rounds, the first the model as it was given.
    pub rounds: Vec<Round>,
    pub conclusion: Conclusion,
    pub to_quote: ToQuote,
}

/// The posterior to quote.
pub enum ToQuote {
    Sampled(Box<Quoted>),
    /// It could not be sampled, for this reason: the intervals to quote are those of the closed form.
    ClosedForm(Error),
}

impl Closed {
    /// The constants to quote: averaged over what may act unseen, or what spans all answers where the account is suspect.
    pub fn quoted(&self) -> Keyed<Interval> {
        match &self.to_quote {
            ToQuote::Sampled(sampled) => {
                sampled.intervals(&closed_forms(&self.rounds, &self.conclusion))
            }
            ToQuote::ClosedForm(_) => closed_form(&self.rounds, &self.conclusion),
        }
    }
}

impl Explained {
    /// The constants to quote in closed form.
    pub fn closed_form(&self) -> Keyed<Interval> {
        closed_form(&self.rounds, &self.conclusion)
    }
}

/// The constants by each answer to quote, in closed form.
fn closed_forms(rounds: &[Round], conclusion: &Conclusion) -> Vec<Keyed<Interval>> {
    match &conclusion.suspect {
        Some(suspect) => {
            let answers = suspect.answers.iter();
            answers.map(|a| a.constants.clone()).collect()
        }
        None => vec![rounds[rounds.len() - 1].tracing.averaged.clone()],
    }
}

fn closed_form(rounds: &[Round], conclusion: &Conclusion) -> Keyed<Interval> {
    match &conclusion.suspect {
        Some(suspect) => suspect.hull(),
        None => rounds[rounds.len() - 1].tracing.averaged.clone(),
    }
}

/// Run a loop to its end: [`explain`], then [`finished`]. `options` gives each stage its own.
///
/// # Errors
/// Those of [`explain`] and [`finished`].
pub fn close<'a>(
    model: &Model,
    most: usize,
    options: &dyn Fn(LoopStage) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Closed> {
    let explained = explain(model, most, options, progress)?;
    finished(explained, options, progress)
}

/// Rounds with the posterior to quote. One that cannot be sampled is no error: the
/// verdict does not depend on it.
///
/// # Errors
/// Work that was told to stop; files that cannot be written.
pub fn finished<'a>(
    explained: Explained,
    options: &dyn Fn(LoopStage) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Closed> {
    let suspect = explained.conclusion.suspect.is_some();
    let of_answer = |supposing| options(LoopStage::Answer(supposing));
    let to_quote = match quote(&explained.rounds, suspect, &of_answer, progress) {
        Ok(sampled) => ToQuote::Sampled(Box::new(sampled)),
        Err(e) if e.ends_all() => return Err(e),
        Err(why) => ToQuote::ClosedForm(why),
    };
    Ok(Closed {
        rounds: explained.rounds,
        conclusion: explained.conclusion,
        to_quote,
    })
}

/// Run rounds until nothing more is accepted, at most `most` refits, none begun after the deadline, and conclude. A later round that the
/// deadline cuts off before there is anything to say of it does not count.
///
/// An added effect that does not lower the misfit, is not told from nothing or cannot be fitted at all is taken out again, and left
/// undecided: an effect is added at most once, and taken out at most once. `most` bounds all attempts, not only those that stay.
///
/// # Errors
/// Those of identifying and tracing the model as it was given; work that was told to stop; files that cannot be written.
pub fn explain<'a>(
    model: &Model,
    most: usize,
    options: &dyn Fn(LoopStage) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Explained> {
    let context = Loop {
        most,
        options,
        progress,
    };
    let given = NextModel {
        model: model.clone(),
        begun: None,
    };
    let mut turn = NextStep::Identify(Course::default(), Box::new(given));
    let course = loop {
        turn = match turn {
            NextStep::Identify(course, next) => context.turn(course, *next)?,
            NextStep::Ended(course) => break context.with_undecided(course),
        };
    };
    Ok(Explained {
        conclusion: conclude(&course.rounds, course.refused.all()),
        rounds: course.rounds,
    })
}

/// What has been done so far.
#[derive(Default)]
struct Course {
    rounds: Vec<Round>,
    refused: Refused,
    attempts: usize,
}

/// What is to be done next.
enum NextStep {
    /// Identify a model, as another round.
    Identify(Course, Box<NextModel>),
    /// Nothing: nothing more is called for, or the time is over.
    Ended(Course),
}

/// A model to be identified: what is declared, with the effects that were added, and where the round before left the test.
struct NextModel {
    model: Model,
    begun: Option<Begun>,
}

impl Course {
    /// Identify the model that the last round calls for, if there is one and after at most `most` attempts to add an effect.
    fn next(self, most: usize) -> NextStep {
        let model = self.rounds.last().and_then(next_model);
        match model.filter(|_| self.attempts <= most) {
            Some(next) => NextStep::Identify(self, Box::new(next)),
            None => NextStep::Ended(self),
        }
    }

    /// The round whose effect does not hold once all others are in the model, and why.
    fn refuted(&self) -> Option<(usize, String)> {
        let (last, before) = self.rounds.split_last()?;
        let mut called = before.iter().enumerate();
        called.find_map(|(k, round)| Some((k, refuted(round, last)?)))
    }
}

/// How a loop is run.
struct Loop<'l, 'o> {
    most: usize,
    options: &'l dyn Fn(LoopStage) -> Options<'o>,
    progress: &'l dyn Progress,
}

impl Loop<'_, '_> {
    /// Identify a model and trace what it leaves.
    fn turn(&self, course: Course, next: NextModel) -> Result<NextStep> {
        let NextModel { model, begun } = next;
        let attempt = course.attempts;
        let options = (self.options)(LoopStage::Attempt(attempt));
        let identified = identify_from(&model, begun, &options, self.progress);
        let round = identified.and_then(|found| self.round(&course, model, found));
        let mut course = Course {
            attempts: attempt + 1,
            ..course
        };
        match round {
            Ok(round) => course.rounds.push(round),
            Err(e) if course.rounds.is_empty() || e.ends_all() => return Err(e),
            Err(e) if e.blame() == Blame::Limit => return Ok(NextStep::Ended(course)),
            // the fit of what was called for: without it the loop goes on
            Err(e) => return self.retraced(course, e.to_string()),
        }
        if is_over(&options) {
            return Ok(NextStep::Ended(course));
        }
        match course.next(self.most) {
            NextStep::Ended(mut course) => match course.refuted() {
                Some((at, why)) => {
                    course.rounds.truncate(at + 1);
                    self.retraced(course, why)
                }
                None => Ok(NextStep::Ended(course)),
            },
            next => Ok(next),
        }
    }

    /// What an identification leaves, traced.
    fn round(&self, course: &Course, model: Model, found: Identification) -> Result<Round> {
        let of = (&course.refused, course.attempts);
        let traced = self.attribute(of, &model, &found.inverse)?;
        found.inverse.prepared.problem.experiment.drop_caches();
        Ok(Round::new(course.attempts, model, found, traced))
    }

    /// Take back the effect that the last round called for and trace that round anew.
    fn retraced(&self, mut course: Course, why: String) -> Result<NextStep> {
        let Some(round) = course.rounds.pop() else {
            return Ok(NextStep::Ended(course));
        };
        let refused = course.refused.and(&round, why);
        let Round {
            attempt,
            model,
            identification,
            ..
        } = round;
        let traced = self.attribute((&refused, attempt), &model, &identification.inverse)?;
        course
            .rounds
            .push(Round::new(attempt, model, identification, traced));
        Ok(Course { refused, ..course }.next(self.most))
    }

    /// Trace a residual to the effects that have not been refused; those are undecided. Stages are kept where the chains of an attempt are.
    fn attribute(
        &self,
        (refused, attempt): (&Refused, usize),
        model: &Model,
        inverse: &InverseProblem,
    ) -> Result<(Tracing, LinearisedEvidence)> {
        let wanted = |name: &str| refused.may_be_sought(name);
        let kept = (self.options)(LoopStage::Attempt(attempt)).stages();
        let (tracing, traced) = attribute_kept((model, inverse), &wanted, &kept, self.progress)?;
        Ok((tracing.without(refused), traced))
    }

    /// The same, once something was found, with the last round's misfit held against what is undecided too: that may be the rest of it. Not
    /// after the deadline.
    fn with_undecided(&self, mut course: Course) -> Course {
        let options = (self.options)(LoopStage::Attempt(course.attempts));
        if course.rounds.len() > 1 && !is_over(&options) {
            let last = course.rounds.pop().map(Round::with_undecided);
            course.rounds.extend(last);
        }
        course
    }
}

fn is_over(options: &Options<'_>) -> bool {
    options.deadline.is_some_and(|end| Instant::now() >= end)
}

/// The model that a round's tracing calls for.
fn next_model(round: &Round) -> Option<NextModel> {
    let tracing = &round.tracing;
    let accepted = tracing.accepted.as_ref()?;
    Some(NextModel {
        model: extended(&round.model, accepted, &tracing.averaged),
        begun: Some(Begun {
            state: begun(round, accepted),
            weighing: round.traced.evidence.weighing.clone(),
            workbench: round.identification.inverse.prepared.workbench.clone(),
        }),
    })
}

/// Where the next round begins: at the constants that were found, with what is declared and what is called for, by its own law alone. Midway
/// between two laws that leave almost one field a rotation of 4.0 mrad stood in the state with half of it under each, and was refitted to 2.0.
fn begun(round: &Round, accepted: &Accepted) -> SeriesState {
    let point = &round.traced.point;
    let mut state = point.state.clone();
    for acts in &point.sought {
        state.remove(acts.effect);
    }
    let called = EffectUnderLaw {
        effect: accepted.effect,
        law: accepted.law,
    };
    let sets = called.weights(&state.loads);
    if called.law == Some(Law::Free) || accepted.effect.kind() == Kind::Recorded {
        return state;
    }
    let weights = sets.first().cloned().unwrap_or_default();
    let own = accepted
        .amplitude
        .iter()
        .take(accepted.effect.parameters().len());
    for (k, (mean, _)) in own.enumerate() {
        state = state.raised(accepted.effect, k, *mean, &weights);
    }
    state
}
