//! The answers to quote, sampled.

use std::time::Instant;

use super::Supposing;
use super::expanded::TestExpansion;
use super::full::Full;
use super::importance::Importance;
use super::pose::{PosedAnswer, steps};
use super::variables::Completed;
use crate::chain::Draws;
use crate::diagnose::{Row, Rule, Verdict, diagnose};
use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::identify::{Options, Reporting};
use crate::progress::Progress;
use crate::sample::LogDensity;
use crate::sample::{self, Ensemble, Sampler, Schedule, Start};
use crate::trace::averaged::Interval;
use crate::trace::round::Round;
use crate::trace::suspect::hull;

/// The posterior to quote.
pub struct Quoted {
    /// Each answer's draws: one where the account is not suspect, and three that the quoted intervals span where it is.
    pub answers: Vec<AnswerDraws>,
    /// The draws to quote: those of the one answer, or of all whose chains have converged in equal parts, with their number as `answer`.
    pub draws: Draws,
}

/// The draws of one answer.
pub struct AnswerDraws {
    /// Its short name: `small`, `all`, `none`.
    pub name: &'static str,
    pub draws: Draws,
    /// Of what the samplers drew.
    pub verdict: Verdict,
    /// How the draws fare under the full model.
    pub importance: Importance,
}

impl Quoted {
    /// The constants to quote: of the one answer, or what spans those of all three; of an answer whose chains have not converged those of
    /// its `closed` form.
    pub fn intervals(&self, closed: &[Keyed<Interval>]) -> Keyed<Interval> {
        let pairs = self.answers.iter().zip(closed);
        let one = |(sampled, closed): (&AnswerDraws, &Keyed<Interval>)| {
            if sampled.verdict.converged {
                sampled.intervals()
            } else {
                closed.clone()
            }
        };
        let answers: Vec<Keyed<Interval>> = pairs.map(one).collect();
        match &answers[..] {
            [only] => only.clone(),
            all => hull(&all.iter().collect::<Vec<_>>()),
        }
    }
}

impl AnswerDraws {
    /// The constants.
    pub fn intervals(&self) -> Keyed<Interval> {
        let constants = self.verdict.rows.iter();
        let interval = |row: &Row| Interval {
            mean: row.mean,
            sd: row.sd,
            low: row.low,
            median: row.median,
            high: row.high,
        };
        constants
            .map(|row| (row.name.clone(), interval(row)))
            .collect()
    }
}

/// How each answer is sampled: its chains have a place and a checkpoint of their own.
type OptionsOf<'f, 'o> = dyn Fn(Supposing) -> Options<'o> + 'f;

/// Sample the posterior to quote of a loop's rounds, with the answers beside it where their account is `suspect`.
///
/// # Errors
/// Those of finite-element solutions and of the samplers; a deadline that leaves no time for draws.
pub fn quote(
    rounds: &[Round],
    suspect: bool,
    options: &OptionsOf<'_, '_>,
    progress: &dyn Progress,
) -> Result<Quoted> {
    let deadline = options(Supposing::Small).deadline;
    if deadline.is_some_and(|end| Instant::now() >= end) {
        return Err(Error::limit(
            "--time-limit",
            "time to sample the posterior to quote",
        ));
    }
    let last = &rounds[rounds.len() - 1];
    let mut answers = sampled(last, &[Supposing::Small], options, progress)?;
    if suspect {
        let others = [Supposing::All, Supposing::None];
        answers.extend(sampled(&rounds[0], &others, options, progress)?);
    }
    let draws = match &answers[..] {
        [only] => only.draws.clone(),
        all => together(all)?,
    };
    Ok(Quoted { answers, draws })
}

/// Takes a density, a point to start from and the sd to start with.
type Showing<'a> = &'a mut dyn FnMut(&dyn LogDensity, &[f64], &[f64]);

/// Show somebody the density of a round's answer to quote where the account is not suspect, with a point to start from and the sd to start
/// with.
///
/// # Errors
/// Those of finite-element solutions.
pub fn with_density(round: &Round, act: Showing<'_>) -> Result<()> {
    let (model, averaged) = (&round.model, &round.tracing.averaged);
    let prepared = &round.identification.inverse.prepared;
    let expanded = TestExpansion::new(&round.traced, model, prepared, steps(model, averaged))?;
    let sampled = PosedAnswer::new(model, &round.traced, &expanded, Supposing::Small)?;
    let (centre, sd) = sampled.start(averaged);
    act(&sampled.answer, &centre, &sd);
    Ok(())
}

/// Some answers of a round.
fn sampled(
    round: &Round,
    which: &[Supposing],
    options: &OptionsOf<'_, '_>,
    progress: &dyn Progress,
) -> Result<Vec<AnswerDraws>> {
    let traced = &round.traced;
    let (model, averaged) = (&round.model, &round.tracing.averaged);
    let prepared = &round.identification.inverse.prepared;
    progress.begin(
        "quoted posterior: sensitivities that follow the constants",
        None,
    );
    let expanded = TestExpansion::new(traced, model, prepared, steps(model, averaged))?;
    let full = Full::new(model, prepared, traced, &expanded)?;
    progress.end();
    let mut answers = Vec::new();
    for &supposing in which {
        let what = format!("quoted posterior: {}", supposing.words());
        progress.begin(&what, None);
        let sampled = PosedAnswer::new(model, traced, &expanded, supposing)?;
        progress.say(&sampled.answer.size_in_words());
        let options = &options(supposing);
        let draws = draw(&sampled, averaged, options, progress)?;
        let mut verdict = diagnose(&draws, &rule(&options.rule));
        progress.end();
        progress.begin(
            "quoted posterior: amplitudes, and the full model at some draws",
            None,
        );
        let Completed { draws, importance } =
            sampled.completed(&draws, &full, options.schedule.seed)?;
        if importance.reweighted {
            // convergence is that of what was drawn, moments are those of what is quoted
            let constants = expanded.here.constants;
            verdict.rows = diagnose(&first(&draws, constants)?, &rule(&options.rule)).rows;
        }
        answers.push(AnswerDraws {
            name: supposing.key(),
            draws,
            verdict,
            importance,
        });
        progress.end();
    }
    prepared.problem.experiment.rest();
    Ok(answers)
}

/// The first variables of draws alone.
fn first(draws: &Draws, count: usize) -> Result<Draws> {
    let values = draws.points().flat_map(|x| x[..count].iter().copied());
    let names = draws.names()[..count].to_vec();
    Draws::new(
        names,
        draws.ensemble().to_vec(),
        values.collect(),
        draws.lp().to_vec(),
    )
}

/// Spread of the start about the mode, in units of its normal approximation.
const SPREAD: f64 = 2.0;

/// Change of tau that ends the run, ten times that of a density of a microsecond: at 0.01 the default test had 20,000 effective draws.
const TAU_CHANGE: f64 = 0.1;

/// Walkers of an ensemble: a density of a tenth of a millisecond wants fewer than one of a microsecond.
const WALKERS: usize = 24;

/// Windows of warm-up, draws and steps between them, at most: answers whose choices lie far apart mix slowly, and are then said not to have
/// converged.
const WARMUP: usize = 16;
const MOST_DRAWS: usize = 1 << 14;
const THIN: usize = 8;

/// Draws of each chain below which nothing can be said.
const FEWEST: usize = 16;

/// The rule by which draws of the posterior to quote are enough, from that of a run.
pub fn rule(given: &Rule) -> Rule {
    Rule {
        tau_change: given.tau_change.max(TAU_CHANGE),
        ..*given
    }
}

/// What the samplers draw of an answer.
fn draw(
    sampled: &PosedAnswer<'_>,
    averaged: &Keyed<Interval>,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Draws> {
    let target = &sampled.answer;
    let (centre, sd) = sampled.start(averaged);
    let dim = target.dim();
    let mut covariance = vec![0.0; dim * dim];
    for (k, sd) in sd.iter().enumerate() {
        covariance[k * (dim + 1)] = sd * sd;
    }
    let start = Start::Ball {
        centre: &centre,
        covariance: &covariance,
        spread: SPREAD,
    };
    let monitor = Reporting {
        progress,
        deadline: options.deadline,
    };
    let given = &options.schedule;
    let schedule = Schedule {
        warmup_windows: given.warmup_windows.min(WARMUP),
        max_draws: given.max_draws.min(MOST_DRAWS),
        thin: given.thin.or(Some(THIN)),
        ..given.clone()
    };
    let small = Ensemble {
        walkers: Some(WALKERS.max(4 * dim)),
        ..Ensemble::default()
    };
    let given = options.sampler;
    let sampler: &dyn Sampler = if given.name() == small.name() {
        &small
    } else {
        given
    };
    let outcome = sample::run_kept(
        target,
        sampler,
        &start,
        &schedule,
        &rule(&options.rule),
        &monitor,
        options.keeping.as_ref(),
    )?;
    if outcome.draws.draws() < FEWEST {
        let expected = format!("time for at least {FEWEST} draws of each chain");
        return Err(Error::limit("--time-limit", expected).found(outcome.draws.draws()));
    }
    Ok(outcome.draws)
}

/// The draws of the answers whose chains have converged, of all if none has: in equal parts, one after the other in every chain, with
/// the answers' numbers.
fn together(answers: &[AnswerDraws]) -> Result<Draws> {
    let none = !answers.iter().any(|a| a.verdict.converged);
    let numbered = answers.iter().enumerate();
    let all: Vec<(usize, &Draws)> = numbered
        .filter(|(_, a)| none || a.verdict.converged)
        .map(|(number, a)| (number, &a.draws))
        .collect();
    let walkers = |d: &Draws| d.chains() / d.ensembles().max(1);
    let fewest = |of: &dyn Fn(&Draws) -> usize| all.iter().map(|(_, d)| of(d)).min().unwrap_or(0);
    let [ensembles, least] = [fewest(&Draws::ensembles), fewest(&walkers)];
    let draws = fewest(&Draws::draws);
    let names: Vec<String> = all
        .first()
        .into_iter()
        .flat_map(|(_, d)| d.names().iter().cloned())
        .collect();
    // an effect that was declared in one answer's round was sought in another's
    let columns: Vec<Vec<Option<usize>>> = all
        .iter()
        .map(|(_, d)| names.iter().map(|n| d.index(n)).collect())
        .collect();
    let (mut values, mut lp, mut ensemble) = (Vec::new(), Vec::new(), Vec::new());
    for (e, w) in (0..ensembles).flat_map(|e| (0..least).map(move |w| (e, w))) {
        ensemble.push(e);
        for k in 0..draws {
            for ((number, d), columns) in all.iter().zip(&columns) {
                let chain = e * walkers(d) + w;
                // those of the longer ones from end to end
                let at = k * d.draws() / draws;
                let point = d.point(chain, at);
                values.push(*number as f64);
                values.extend(columns.iter().map(|c| c.map_or(0.0, |c| point[c])));
                lp.push(d.lp()[chain * d.draws() + at]);
            }
        }
    }
    let names = std::iter::once("answer".to_string()).chain(names);
    Draws::new(names.collect(), ensemble, values, lp)
}
