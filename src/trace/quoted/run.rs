//! The answers to quote, sampled.

use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::Scenario;
use super::pose::PosedAnswer;
use super::variables::Completed;
use crate::chain::Draws;
use crate::diagnose::{Row, Rule, Verdict, diagnose};
use crate::error::{Error, Result};
use crate::files::{KeptStages, Keyed, to_bytes};
use crate::identify::{Options, forward, reaches};
use crate::infer::Marginal;
use crate::linearise::{Forward, Sensitivities};
use crate::numeric::diagonal;
use crate::parameter::Parameter;
use crate::posterior::{
    About, CoarseForwards, Full, FullModels, Importance, LinearisationPoint, TestExpansion,
};
use crate::progress::Progress;
use crate::sample::{
    self, Ensemble, Key, LogDensity, Outcome, POOR, Regime, Sampler, Schedule, Start, Stream,
    adapted,
};
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
    /// How independent proposals fared; none where another sampler than the ensemble was asked for.
    pub proposals: Option<Proposals>,
    /// How the draws fare under the full model.
    pub importance: Importance,
}

/// How proposals from the closed form, fitted to the density, fared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Proposals {
    /// Effective share of them as importance samples.
    pub effective: f64,
    /// Share that the chains accepted; none where they were poor and the ensemble sampled in their place.
    pub accepted: Option<f64>,
}

/// What is kept of an answer.
type SampledAnswer = ((Draws, Verdict), (Option<Proposals>, Importance));

impl Proposals {
    /// What there is to say of them.
    pub fn words(&self) -> String {
        match self.accepted {
            Some(accepted) => format!(
                "{:.0} % of independent proposals accepted",
                100.0 * accepted
            ),
            None => format!(
                "sampled by the ensemble, because independent proposals have an effective share of {:.2}, below {POOR}",
                self.effective
            ),
        }
    }
}

impl Quoted {
    /// The constants to quote: of the one answer, or what spans those of all three; of an answer whose chains have not converged those of
    /// its `closed` form. Answers that the closed forms have beside those that were sampled are spanned as they are.
    pub fn intervals(&self, closed: &[Keyed<Interval>]) -> Keyed<Interval> {
        let pairs = self.answers.iter().zip(closed);
        let one = |(sampled, closed): (&AnswerDraws, &Keyed<Interval>)| {
            if sampled.verdict.converged {
                sampled.intervals()
            } else {
                closed.clone()
            }
        };
        let further = closed.iter().skip(self.answers.len()).cloned();
        let answers: Vec<Keyed<Interval>> = pairs.map(one).chain(further).collect();
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
type OptionsOf<'f, 'o> = dyn Fn(Scenario) -> Options<'o> + 'f;

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
    let deadline = options(Scenario::Small).deadline;
    if deadline.is_some_and(|end| Instant::now() >= end) {
        return Err(Error::limit(
            "--time-limit",
            "time to sample the posterior to quote",
        ));
    }
    let last = &rounds[rounds.len() - 1];
    let all = [Scenario::Small, Scenario::All, Scenario::None];
    let (own, others) = all.split_at(match rounds.len() {
        // all about the same round, of which one expansion serves
        1 if suspect => all.len(),
        _ => 1,
    });
    let mut answers = sampled(last, own, options, progress)?;
    if suspect && !others.is_empty() {
        answers.extend(sampled(&rounds[0], others, options, progress)?);
    }
    let draws = match &answers[..] {
        [only] => only.draws.clone(),
        all => together(all)?,
    };
    Ok(Quoted { answers, draws })
}

/// Where the test of a round is expanded: about the mode that its own model has, unless tracing has moved elsewhere. With the linearisation
/// there, if it is known.
fn centre(round: &Round) -> Result<(LinearisationPoint, Option<Sensitivities>)> {
    let inverse = &round.identification.inverse;
    let traced = &round.traced.point;
    if to_bytes(traced)? != to_bytes(&inverse.point)? {
        return Ok((traced.clone(), None));
    }
    let state = inverse.about.state.clone();
    let is_known = to_bytes(&state)? == to_bytes(&traced.state)?;
    let known = is_known.then(|| inverse.sensitivities.clone());
    let point = LinearisationPoint {
        state,
        ..traced.clone()
    };
    Ok((point, known))
}

/// Some answers of a round.
fn sampled(
    round: &Round,
    which: &[Scenario],
    options: &OptionsOf<'_, '_>,
    progress: &dyn Progress,
) -> Result<Vec<AnswerDraws>> {
    let traced = &round.traced;
    let prepared = &round.identification.inverse.prepared;
    let fine = forward(&round.model, prepared, &traced.evidence.measured, &|| ());
    let coarse = round.identification.inverse.coarse.as_ref();
    let coarse =
        coarse.map(|c| c.forwards(&round.model, prepared, &round.traced.evidence.measured));
    let made_of = to_bytes(&(traced.made_of(&round.model), &round.tracing.averaged))?;
    let Some(kept) = which.first().map(|first| options(*first).stages()) else {
        return Ok(Vec::new());
    };
    let meshes = RoundMeshes {
        round,
        centre: centre(round)?,
        fine: &fine,
        coarse: coarse.as_ref(),
        // answers beside the account may be as wide as the prior
        is_wider: which.iter().any(|s| *s != Scenario::Small),
        progress,
    };
    let expand = || meshes.expanded();
    let test = AnsweredTest {
        meshes: &meshes,
        expanded: Arc::new(kept.stage("slopes", &made_of, expand, progress)?),
    };
    let mut answers = Vec::new();
    for &supposing in which {
        answers.push(test.answer(supposing, &options(supposing), &made_of)?);
    }
    prepared.problem.experiment.drop_caches();
    Ok(answers)
}

/// A round's test on its meshes.
struct RoundMeshes<'a> {
    round: &'a Round,
    /// The point about which the test is expanded, and its linearisation there, if that is known.
    centre: (LinearisationPoint, Option<Sensitivities>),
    fine: &'a Forward<'a>,
    coarse: Option<&'a CoarseForwards<'a>>,
    is_wider: bool,
    progress: &'a dyn Progress,
}

impl RoundMeshes<'_> {
    /// The test about the point of the round.
    fn expanded(&self) -> Result<TestExpansion> {
        let what = "quoted posterior: sensitivities that follow the constants";
        self.progress.begin(what, None);
        let (evidence, (point, known)) = (&self.round.traced.evidence, &self.centre);
        let model = &self.round.model;
        let names = model.constants().iter().zip(model.marginals());
        let sd = |(name, m): (&&str, Marginal)| match self.round.tracing.averaged.get(*name) {
            Some(own) if !self.is_wider => own.sd,
            _ => m.sd,
        };
        let sds: Vec<f64> = names.map(sd).collect();
        let (steps, reach) = reaches(model, &sds);
        let at = About {
            state: &point.state,
            declared: &point.declared,
            sought: &point.sought,
            here: known.clone(),
            steps,
            reach,
            norms: &|errors| evidence.norms(errors),
        };
        let expanded = TestExpansion::new(&at, self.fine, self.coarse);
        self.progress.end();
        expanded
    }
}

/// A round's test with its expansion about a point, of which answers are sampled.
struct AnsweredTest<'a> {
    meshes: &'a RoundMeshes<'a>,
    expanded: Arc<TestExpansion>,
}

impl AnsweredTest<'_> {
    /// One answer; `of` are the bytes of the round.
    fn answer(
        &self,
        supposing: Scenario,
        options: &Options<'_>,
        made_of: &[u8],
    ) -> Result<AnswerDraws> {
        let Schedule {
            max_draws, thin, ..
        } = options.schedule;
        let own = (made_of, format!("{:?} {max_draws} {thin:?}", options.rule));
        let make = || self.sampled(supposing, options);
        // what a deadline cuts off is no finished stage
        let kept = match options.deadline {
            Some(_) => KeptStages::default(),
            None => options.stages(),
        };
        let found = kept.stage("answer", &own, make, self.meshes.progress)?;
        let ((draws, verdict), (proposals, importance)) = found;
        Ok(AnswerDraws {
            name: supposing.key(),
            draws,
            verdict,
            proposals,
            importance,
        })
    }

    fn sampled(&self, supposing: Scenario, options: &Options<'_>) -> Result<SampledAnswer> {
        let RoundMeshes {
            round,
            fine,
            coarse,
            progress,
            centre: (ref point, _),
            ..
        } = *self.meshes;
        progress.begin(&format!("quoted posterior: {}", supposing.words()), None);
        let expanded = Arc::clone(&self.expanded);
        let sampled = PosedAnswer::new(&round.model, &round.traced, expanded, supposing)?;
        progress.say(&sampled.posed.density.size_in_words());
        let (draws, proposals) = draw(&sampled, &round.tracing.averaged, options, progress)?;
        let mut verdict = diagnose(&draws, &rule(&options.rule));
        progress.end();
        progress.begin(
            "quoted posterior: amplitudes, and the full model at some draws",
            None,
        );
        let full = |forward, here| Full {
            forward,
            point,
            here,
        };
        let rough = coarse.map(|c| full(&c.at_few_points, &self.expanded.about));
        let models = FullModels {
            fine: &full(fine, &self.expanded.here),
            coarse: rough.as_ref(),
        };
        let Completed { draws, importance } =
            sampled.completed(&draws, models, options.schedule.seed)?;
        if let Some((name, [shift, error])) = importance.largest() {
            progress.say(&format!("{name} {shift:+.2} +- {error:.2} sd"));
        }
        if importance.corrected {
            // convergence is that of what was drawn, moments are those of what is quoted
            let constants = draws.only(&draws.names()[..self.expanded.here.constants])?;
            verdict.rows = diagnose(&constants, &rule(&options.rule)).rows;
        }
        progress.end();
        Ok(((draws, verdict), (proposals, importance)))
    }
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

/// Steps of warm-up of independent proposals, whose chains start at weighed draws of the density itself.
const SETTLING: usize = 4;

/// Streams with which proposals are fitted, apart from those of any ensemble.
const FITTING: u64 = u64::MAX - 3;

/// What the samplers draw of an answer: by independent proposals in the place of the ensemble, unless they are poor.
fn draw(
    sampled: &PosedAnswer<'_>,
    averaged: &Keyed<Interval>,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<(Draws, Option<Proposals>)> {
    let given = options.sampler;
    if given.name() != Ensemble::default().name() {
        let draws = by_walkers(sampled, averaged, (options, given), progress)?;
        return Ok((draws, None));
    }
    let target = &sampled.posed.density;
    let key = Key {
        seed: options.schedule.seed,
        ensemble: FITTING,
    };
    let (effective, fitted) = adapted(target, &sampled.closed, key)?;
    let Some(sampler) = fitted else {
        let ensemble = Ensemble {
            walkers: Some(WALKERS.max(4 * target.dim())),
            ..Ensemble::default()
        };
        let proposals = Proposals {
            effective,
            accepted: None,
        };
        let draws = by_walkers(sampled, averaged, (options, &ensemble), progress)?;
        return Ok((draws, Some(proposals)));
    };
    let place = |_: usize, _: usize, rng: &mut Stream| sampler.place(rng);
    let start = Start::Walkers {
        place: &place,
        covariance: sampler.covariance(),
    };
    let schedule = Schedule {
        warmup: options.schedule.warmup.or(Some(SETTLING)),
        thin: options.schedule.thin.or(Some(1)),
        ..options.schedule.clone()
    };
    let draws = run(target, (&sampler, &start), &schedule, options, progress)?;
    let moves = &draws.info.moves;
    let [proposed, accepted] = [
        moves.iter().map(|m| m.proposed).sum::<u64>(),
        moves.iter().map(|m| m.accepted).sum(),
    ];
    let proposals = Proposals {
        effective,
        accepted: Some(accepted as f64 / proposed.max(1) as f64),
    };
    Ok((draws, Some(proposals)))
}

/// What a sampler draws whose walkers start about the closed form.
fn by_walkers(
    sampled: &PosedAnswer<'_>,
    averaged: &Keyed<Interval>,
    (options, sampler): (&Options<'_>, &dyn Sampler),
    progress: &dyn Progress,
) -> Result<Draws> {
    let (centre, sd) = sampled.start(averaged);
    let start = Start::Ball {
        centre: &centre,
        covariance: &diagonal(sd.iter().map(|sd| sd * sd)),
        spread: SPREAD,
    };
    let given = &options.schedule;
    let schedule = Schedule {
        warmup_windows: given.warmup_windows.min(WARMUP),
        thin: given.thin.or(Some(THIN)),
        ..given.clone()
    };
    run(
        &sampled.posed.density,
        (sampler, &start),
        &schedule,
        options,
        progress,
    )
}

/// Draws by a schedule, until they are enough.
fn run(
    target: &dyn LogDensity,
    (sampler, start): (&dyn Sampler, &Start<'_>),
    schedule: &Schedule,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<Draws> {
    let schedule = Schedule {
        max_draws: schedule.max_draws.min(MOST_DRAWS),
        ..schedule.clone()
    };
    let Outcome { draws, .. } = sample::run_kept(
        target,
        sampler,
        start,
        &Regime {
            schedule: &schedule,
            stop: &rule(&options.rule),
            monitor: &options.reporting(progress),
        },
        options.keeping.as_ref(),
    )?;
    if draws.draws() < FEWEST {
        let expected = format!("time for at least {FEWEST} draws of each chain");
        return Err(Error::limit("--time-limit", expected).found(draws.draws()));
    }
    Ok(draws)
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
    let names = std::iter::once(Parameter::answer().name()).chain(names);
    Draws::new(names.collect(), ensemble, values, lp)
}
