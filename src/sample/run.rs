//! The schedule: independent ensembles in parallel, warm-up in doubling windows until it has settled, then blocks of
//! steps until a stopping rule is satisfied or the draws are used up.

use rayon::prelude::*;

use super::start::Start;
use super::stream::Key;
use super::{Block, Sampler, Span, State};
use crate::chain::Draws;
use crate::error::{Error, Result};
use crate::infer::LogDensity;

/// When to end warm-up and when to end the run; see `diagnose::Rule`.
pub trait Stop: Sync {
    /// After a warm-up window, whose every step is in `window`: the thinning of the run if warm-up is over.
    fn settled(&self, window: &Draws) -> Option<usize>;

    /// The thinning to use if warm-up never settled.
    fn fallback(&self, window: &Draws) -> usize;

    /// Whether all `draws` since warm-up are enough.
    fn enough(&self, draws: &Draws) -> bool;
}

/// What the run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Adapting and forgetting the start; draws are thrown away.
    Warmup,
    /// Keeping draws.
    Sampling,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Warm-up or sampling.
    pub phase: Phase,
    /// Steps of each ensemble so far.
    pub steps: u64,
    /// Draws stored so far, over all chains.
    pub draws: usize,
    /// Draws at which the run ends in any case.
    pub most: usize,
    /// Mean acceptance rate of the last block.
    pub acceptance: f64,
}

/// Watches a run; called between blocks, from the thread that called [`run`].
pub trait Progress {
    /// Tells how far the run has come; `false` ends it here (a time limit, an interrupt).
    fn report(&self, report: &Report) -> bool;
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn report(&self, _report: &Report) -> bool {
        true
    }
}

/// How much to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// Seed of every stream.
    pub seed: u64,
    /// Number of independent ensembles (or chains).
    pub ensembles: usize,
    /// Most steps of warm-up of each ensemble, in windows of the sampler; at least 1.
    pub warmup_windows: usize,
    /// Exactly this many steps of warm-up instead of a decision from the draws.
    pub warmup: Option<usize>,
    /// Most draws stored, over all chains.
    pub max_draws: usize,
    /// Steps between stored draws instead of a decision from the warm-up.
    pub thin: Option<usize>,
    /// Growth of the run from one check of the stopping rule to the next, > 1.
    pub growth: f64,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            seed: 0,
            ensembles: 4,
            warmup_windows: 128,
            warmup: None,
            max_draws: 1_000_000,
            thin: None,
            growth: 1.5,
        }
    }
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// The stopping rule was satisfied.
    Enough,
    /// The most draws were stored first.
    MaxDraws,
    /// The progress callback ended it.
    Interrupted,
}

/// What a run gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Draws after warm-up.
    pub draws: Draws,
    /// Why the run ended.
    pub stopped: Stopped,
    /// Whether warm-up settled before its limit (true where its length was prescribed).
    pub settled: bool,
    /// The state of each ensemble, from which the run could go on.
    pub states: Vec<State>,
}

/// Runs `schedule.ensembles` independent ensembles of `sampler` on `target`. The draws depend on the seed alone, not on
/// the number of threads.
///
/// # Errors
/// The input's fault: a schedule that makes no sense, or a start that is refused (see [`Start`]).
pub fn run(
    target: &dyn LogDensity,
    sampler: &dyn Sampler,
    start: &Start<'_>,
    schedule: &Schedule,
    stop: &dyn Stop,
    progress: &dyn Progress,
) -> Result<Outcome> {
    check(schedule)?;
    let keys = (0..schedule.ensembles as u64).map(|ensemble| Key {
        seed: schedule.seed,
        ensemble,
    });
    let states: Result<Vec<State>> = keys
        .clone()
        .map(|key| start.begin(target, sampler, key))
        .collect();
    let mut crew = Crew {
        target,
        sampler,
        keys: keys.collect(),
        states: states?,
    };
    let warm = warm_up(&mut crew, schedule, stop, progress)?;
    let (draws, stopped) = if warm.interrupted {
        (crew.collect(&[])?, Stopped::Interrupted)
    } else {
        keep(&mut crew, schedule, warm.thin, stop, progress)?
    };
    let mut draws = draws;
    draws.info.thin = warm.thin;
    draws.info.warmup = warm.steps;
    Ok(Outcome {
        draws,
        stopped,
        settled: warm.settled,
        states: crew.states,
    })
}

fn check(schedule: &Schedule) -> Result<()> {
    let growth = schedule.growth > 1.0 && schedule.growth.is_finite();
    if schedule.ensembles == 0 || schedule.warmup_windows == 0 || schedule.max_draws == 0 || !growth
    {
        return Err(Error::input(
            "schedule",
            "at least one ensemble, one warm-up window, one draw, and a growth above 1",
        )
        .found(format!("{schedule:?}")));
    }
    if schedule.thin == Some(0) {
        return Err(Error::input("thinning", "at least 1").found(0));
    }
    Ok(())
}

/// The ensembles of a run.
struct Crew<'a> {
    target: &'a dyn LogDensity,
    sampler: &'a dyn Sampler,
    keys: Vec<Key>,
    states: Vec<State>,
}

impl Crew<'_> {
    /// Advances every ensemble by the same span, in parallel.
    fn advance(&mut self, span: Span) -> Vec<Block> {
        let (target, sampler) = (self.target, self.sampler);
        self.states
            .par_iter_mut()
            .zip(&self.keys)
            .map(|(state, &key)| sampler.advance(target, key, span, state))
            .collect()
    }

    fn steps(&self) -> u64 {
        self.states.first().map_or(0, |s| s.step)
    }

    fn walkers(&self) -> usize {
        self.states.first().map_or(1, |s| s.lp.len())
    }

    /// Brings blocks from [draw][walker] to [chain][draw].
    fn collect(&self, blocks: &[Block]) -> Result<Draws> {
        let (dim, walkers) = (self.target.dim(), self.walkers());
        let chains = walkers * self.states.len();
        let total: usize = blocks.iter().map(|b| b.lp.len()).sum();
        let mut values = Vec::with_capacity(total * dim);
        let mut lp = Vec::with_capacity(total);
        for block in blocks {
            let draws = block.lp.len() / walkers;
            for walker in 0..walkers {
                for row in (0..draws).map(|draw| draw * walkers + walker) {
                    values.extend_from_slice(&block.x[row * dim..(row + 1) * dim]);
                    lp.push(block.lp[row]);
                }
            }
        }
        let ensemble = (0..chains).map(|chain| chain / walkers).collect();
        Draws::new(self.target.names().to_vec(), ensemble, values, lp)
    }
}

/// How warm-up ended.
struct Warm {
    steps: usize,
    thin: usize,
    settled: bool,
    interrupted: bool,
}

/// Windows of 1, 1, 2, 4, ... times the sampler's, until the last one alone looks stationary.
fn warm_up(
    crew: &mut Crew<'_>,
    schedule: &Schedule,
    stop: &dyn Stop,
    progress: &dyn Progress,
) -> Result<Warm> {
    let unit = crew.sampler.window(crew.target.dim());
    let most = unit * schedule.warmup_windows;
    let mut warm = Warm {
        steps: 0,
        thin: 1,
        settled: false,
        interrupted: false,
    };
    while !warm.settled && !warm.interrupted {
        let steps = match schedule.warmup {
            Some(steps) => steps,
            None => warm.steps.max(unit).min(most - warm.steps),
        };
        let blocks = crew.advance(Span {
            steps,
            thin: 1,
            warmup: true,
        });
        warm.steps += steps;
        let window = crew.collect(&blocks)?;
        warm.settled = match stop.settled(&window) {
            Some(thin) => {
                warm.thin = thin;
                true
            }
            None => {
                warm.thin = stop.fallback(&window);
                schedule.warmup.is_some()
            }
        };
        warm.interrupted = !progress.report(&Report {
            phase: Phase::Warmup,
            steps: crew.steps(),
            draws: 0,
            most: schedule.max_draws,
            acceptance: acceptance(&blocks, steps),
        });
        if warm.steps >= most {
            break;
        }
    }
    warm.thin = schedule.thin.unwrap_or(warm.thin).max(1);
    Ok(warm)
}

/// Blocks of kept draws, each making the run `growth` times as long, until the rule or the limit ends it.
fn keep(
    crew: &mut Crew<'_>,
    schedule: &Schedule,
    thin: usize,
    stop: &dyn Stop,
    progress: &dyn Progress,
) -> Result<(Draws, Stopped)> {
    let chains = crew.walkers() * crew.states.len();
    let most = (schedule.max_draws / chains).max(4);
    let first = crew.sampler.window(crew.target.dim()).div_ceil(thin).max(4);
    let mut all = crew.collect(&[])?;
    let mut totals: Vec<Block> = Vec::new();
    let stopped = loop {
        let grown = (all.draws() as f64 * schedule.growth).ceil() as usize;
        let count = grown.max(first).min(most) - all.draws();
        let mut blocks = crew.advance(Span {
            steps: count * thin,
            thin,
            warmup: false,
        });
        all.append(&crew.collect(&blocks)?)?;
        let rate = acceptance(&blocks, count * thin);
        merge(&mut totals, &mut blocks);
        let go_on = progress.report(&Report {
            phase: Phase::Sampling,
            steps: crew.steps(),
            draws: all.len(),
            most: schedule.max_draws,
            acceptance: rate,
        });
        if stop.enough(&all) {
            break Stopped::Enough;
        } else if !go_on {
            break Stopped::Interrupted;
        } else if all.draws() >= most {
            break Stopped::MaxDraws;
        }
    };
    describe(&mut all, &totals, thin);
    Ok((all, stopped))
}

fn acceptance(blocks: &[Block], steps: usize) -> f64 {
    let walkers: usize = blocks.iter().map(|b| b.accepted.len()).sum();
    let moved: u64 = blocks.iter().flat_map(|b| &b.accepted).sum();
    moved as f64 / (walkers * steps).max(1) as f64
}

/// Adds the tallies of `blocks` to those of the run; the draws are already taken.
fn merge(totals: &mut Vec<Block>, blocks: &mut Vec<Block>) {
    for block in &mut *blocks {
        block.x = Vec::new();
        block.lp = Vec::new();
    }
    if totals.is_empty() {
        std::mem::swap(totals, blocks);
        return;
    }
    for (total, block) in totals.iter_mut().zip(&*blocks) {
        total.nan += block.nan;
        total.evaluations += block.evaluations;
        for (a, b) in total.accepted.iter_mut().zip(&block.accepted) {
            *a += b;
        }
        for (a, b) in total.moves.iter_mut().zip(&block.moves) {
            a.proposed += b.proposed;
            a.accepted += b.accepted;
        }
    }
}

fn describe(draws: &mut Draws, totals: &[Block], thin: usize) {
    let steps = (draws.draws() * thin).max(1) as f64;
    let rates = totals.iter().flat_map(|b| &b.accepted);
    draws.info.acceptance = rates.map(|&n| n as f64 / steps).collect();
    draws.info.nan = totals.iter().map(|b| b.nan).sum();
    draws.info.evaluations = totals.iter().map(|b| b.evaluations).sum();
    if let Some((first, rest)) = totals.split_first() {
        draws.info.moves = first.moves.clone();
        for (k, tally) in draws.info.moves.iter_mut().enumerate() {
            tally.proposed += rest.iter().map(|b| b.moves[k].proposed).sum::<u64>();
            tally.accepted += rest.iter().map(|b| b.moves[k].accepted).sum::<u64>();
        }
    }
}
