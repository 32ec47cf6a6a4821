//! The schedule: independent ensembles in parallel, warm-up in doubling windows until it has settled, then blocks of
//! steps until a stopping rule is satisfied or the draws are used up.

use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::checkpoint::Warm;
use super::density::LogDensity;
use super::keep::{Keeper, Keeping, PATIENCE};
use super::memory::{Count, Memory};
use super::schedule::{Monitor, Outcome, Phase, PhaseReport, Regime, Schedule, Stop, Stopped};
use super::start::Start;
use super::stream::Key;
use super::{Block, EnsembleState, Sampler, Span};
use crate::chain::{Draws, Layout};
use crate::error::{Error, Result};

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
    progress: &dyn Monitor,
) -> Result<Outcome> {
    let regime = Regime {
        schedule,
        stop,
        monitor: progress,
    };
    run_kept(target, sampler, start, &regime, None)
}

/// The same with its draws stored as `keeping` says; it may go on from where an earlier run was killed.
///
/// # Errors
/// Those of [`run`], a store that cannot be written, and one that is damaged or of another run.
pub fn run_kept(
    target: &dyn LogDensity,
    sampler: &dyn Sampler,
    start: &Start<'_>,
    regime: &Regime<'_>,
    keeping: Option<&Keeping>,
) -> Result<Outcome> {
    let schedule = regime.schedule;
    schedule.check()?;
    let mut crew = Crew::new(target, sampler, schedule);
    let mut warm = Warm {
        steps: 0,
        thin: 1,
        settled: false,
        over: false,
    };
    if let Some(keeping) = keeping {
        crew.open(keeping, schedule, &mut warm)?;
    }
    if crew.states.is_empty() {
        let begin = |&key: &Key| start.begin(target, sampler, key);
        crew.states = crew
            .keys
            .iter()
            .map(begin)
            .collect::<Result<Vec<EnsembleState>>>()?;
        crew.flush(warm, true)?;
    }
    let mut stopped = Stopped::Interrupted;
    let mut draws = None;
    if warm.over || warm_up(&mut crew, regime, &mut warm)? {
        (stopped, draws) = keep(&mut crew, regime, warm)?;
    }
    if warm.over {
        crew.flush(warm, true)?;
    }
    let draws = match draws {
        Some(draws) => draws,
        None => crew.draws(warm)?,
    };
    Ok(Outcome {
        draws,
        stopped,
        settled: warm.settled || schedule.warmup.is_some(),
        states: crew.states,
    })
}

/// The ensembles of a run, and what they have drawn.
struct Crew<'a> {
    target: &'a dyn LogDensity,
    sampler: &'a dyn Sampler,
    keys: Vec<Key>,
    states: Vec<EnsembleState>,
    memory: Memory,
    /// Most draws of a chain in memory.
    most: usize,
    /// What the ensembles did last.
    blocks: Vec<Block>,
    totals: Vec<Block>,
    keeper: Option<Keeper>,
    pace: Pace,
}

/// Bytes of the draws of one ensemble between two joins of the threads: a few milliseconds of work, which the
/// processor's cache holds.
const BLOCK: usize = 1 << 20;

/// How many draws take about a quarter of the time between flushes, or fill a block; no draw depends on it.
struct Pace {
    draws: usize,
    most: usize,
}

impl Pace {
    /// For draws of `numbers` numbers an ensemble.
    fn new(numbers: usize) -> Self {
        let most = (BLOCK / (8 * numbers.max(1))).max(1);
        Self {
            draws: most.min(64),
            most,
        }
    }

    /// Steps of the next span, a multiple of `thin` unless fewer are left.
    fn steps(&self, left: usize, thin: usize) -> usize {
        self.draws.saturating_mul(thin).min(left)
    }

    fn learn(&mut self, draws: usize, took: Duration) {
        let wanted = PATIENCE.as_secs_f64() / 4.0;
        let factor = (wanted / took.as_secs_f64().max(1e-9)).clamp(0.1, 4.0);
        self.draws = ((draws as f64 * factor) as usize).clamp(1, self.most);
    }
}

impl<'a> Crew<'a> {
    fn new(target: &'a dyn LogDensity, sampler: &'a dyn Sampler, schedule: &Schedule) -> Self {
        let key = |ensemble| Key {
            seed: schedule.seed,
            ensemble,
        };
        let walkers = sampler.walkers(target.dim());
        Self {
            target,
            sampler,
            keys: (0..schedule.ensembles as u64).map(key).collect(),
            states: Vec::new(),
            memory: Memory::new(schedule.ensembles, walkers, target.dim()),
            most: (schedule.memory / (schedule.ensembles * walkers).max(1)).max(1),
            blocks: vec![Block::default(); schedule.ensembles],
            totals: Vec::new(),
            keeper: None,
            pace: Pace::new(walkers * (target.dim() + 1)),
        }
    }

    /// Makes the store, or takes up the run in it.
    fn open(&mut self, keeping: &Keeping, schedule: &Schedule, warm: &mut Warm) -> Result<()> {
        let layout = Layout {
            names: self.target.names().to_vec(),
            walkers: self.walkers(),
            ensembles: schedule.ensembles,
            observed: keeping.observed.clone(),
        };
        if keeping.resume {
            let memory = &mut self.memory;
            let found = Keeper::reopen(keeping, layout.clone(), self.target, memory, self.most)?;
            if let Some((keeper, checkpoint)) = found {
                *warm = checkpoint.warm;
                self.states = checkpoint.states;
                self.totals = checkpoint.totals;
                self.keeper = Some(keeper);
                return Ok(());
            }
        }
        self.keeper = Some(Keeper::create(keeping, layout)?);
        Ok(())
    }

    /// Advances every ensemble by the same span, in parallel; the draws go to the memory of the run, or to that of a
    /// `window` of warm-up.
    fn advance(&mut self, span: Span, window: Option<&mut Memory>) -> Result<()> {
        let (target, sampler) = (self.target, self.sampler);
        let began = Instant::now();
        let memory = window.unwrap_or(&mut self.memory);
        let ensembles = self.states.par_iter_mut().zip(&self.keys);
        let counts = ensembles
            .zip(&mut self.blocks)
            .zip(memory.shares())
            .map(|(((state, &key), block), mut share)| {
                sampler.advance(target, key, span, state, block)?;
                share.take(block);
                Ok(share.count())
            })
            .collect::<Result<Vec<Count>>>()?;
        match counts.first() {
            Some(&count) if counts.len() == self.keys.len() => memory.taken(count),
            _ => {
                return Err(Error::program(
                    "run",
                    "room for the draws of every ensemble",
                ));
            }
        }
        self.pace.learn(span.steps / span.thin, began.elapsed());
        Ok(())
    }

    /// Draws of each chain so far, held or not.
    fn rows(&self) -> usize {
        self.memory.seen()
    }

    /// Lends the draws held in memory, and how they came about.
    fn draws(&mut self, warm: Warm) -> Result<Draws> {
        let mut draws = self.memory.lend(self.target.names())?;
        describe(&mut draws, &self.totals, self.rows() * warm.thin);
        draws.info.thin = warm.thin * self.memory.stride();
        draws.info.warmup = warm.steps;
        Ok(draws)
    }

    fn steps(&self) -> u64 {
        self.states.first().map_or(0, |s| s.step)
    }

    fn walkers(&self) -> usize {
        self.sampler.walkers(self.target.dim())
    }

    fn chains(&self) -> usize {
        self.walkers() * self.keys.len()
    }

    /// Brings the store up to date if it is time for it, or if it `must` be.
    fn flush(&mut self, warm: Warm, must: bool) -> Result<()> {
        let steps = self.rows() * warm.thin;
        let Some(keeper) = &mut self.keeper else {
            return Ok(());
        };
        if must || keeper.due() {
            keeper.flush(
                warm,
                &self.states,
                &self.totals,
                &rates(&self.totals, steps),
            )?;
        }
        Ok(())
    }
}

/// Windows of 1, 1, 2, 4, ... times the sampler's, until the last one alone looks stationary; false if interrupted.
fn warm_up(crew: &mut Crew<'_>, regime: &Regime<'_>, warm: &mut Warm) -> Result<bool> {
    let Regime { schedule, stop, .. } = *regime;
    let unit = crew.sampler.window(crew.target.dim());
    let most = unit * schedule.warmup_windows;
    while !warm.over {
        let steps = match schedule.warmup {
            Some(steps) => steps,
            None => warm.steps.max(unit).min(most - warm.steps),
        };
        let Some(window) = warm_up_window(crew, regime, steps)? else {
            return Ok(false);
        };
        warm.steps += steps;
        let settled = stop.settled(&window);
        warm.settled = settled.is_some();
        warm.thin = settled.unwrap_or_else(|| stop.fallback(&window));
        warm.over = warm.settled || schedule.warmup.is_some() || warm.steps >= most;
        if warm.over {
            warm.thin = schedule.thin.unwrap_or(warm.thin).max(1);
        }
        crew.flush(*warm, warm.over)?;
    }
    Ok(true)
}

/// One window of warm-up; none if interrupted.
fn warm_up_window(crew: &mut Crew<'_>, regime: &Regime<'_>, steps: usize) -> Result<Option<Draws>> {
    let mut window = Memory::new(crew.keys.len(), crew.walkers(), crew.target.dim());
    window.reserve(steps);
    let mut done = 0;
    while done < steps {
        let span = Span {
            steps: crew.pace.steps(steps - done, 1),
            thin: 1,
            warmup: true,
        };
        crew.advance(span, Some(&mut window))?;
        done += span.steps;
        let go_on = regime.monitor.report(&PhaseReport {
            phase: Phase::Warmup,
            steps: crew.steps(),
            draws: 0,
            acceptance: acceptance(&crew.blocks, span.steps),
        });
        if !go_on {
            return Ok(None);
        }
    }
    window.lend(crew.target.names()).map(Some)
}

/// Draws until the rule or a limit ends the run; the rule looks whenever the run is `growth` times as long as before.
/// With the reason come the draws that the rule saw last, unless more were drawn since.
fn keep(crew: &mut Crew<'_>, regime: &Regime<'_>, warm: Warm) -> Result<(Stopped, Option<Draws>)> {
    let Regime {
        schedule,
        stop,
        monitor,
    } = *regime;
    let (dim, thin) = (crew.target.dim(), warm.thin);
    let most = (schedule.max_draws / crew.chains()).max(4);
    let first = crew.sampler.window(dim).div_ceil(thin).max(4);
    let mut check = first.min(most);
    loop {
        crew.memory.reserve(check.min(crew.most));
        while crew.rows() < check {
            let left = (check - crew.rows()) * thin;
            let span = Span {
                steps: crew.pace.steps(left, thin),
                thin,
                warmup: false,
            };
            crew.advance(span, None)?;
            if let Some(keeper) = &mut crew.keeper {
                keeper.record(&crew.blocks)?;
            }
            merge(&mut crew.totals, &crew.blocks);
            crew.flush(warm, false)?;
            let go_on = monitor.report(&PhaseReport {
                phase: Phase::Sampling,
                steps: crew.steps(),
                draws: crew.rows() * crew.chains(),
                acceptance: acceptance(&crew.blocks, span.steps),
            });
            if !go_on {
                return Ok((Stopped::Interrupted, None));
            }
        }
        // A resumed run may be beyond this point: it has been looked at there, and was not enough.
        if crew.rows() == check || crew.rows() >= most {
            let draws = crew.draws(warm)?;
            if stop.enough(&draws) {
                return Ok((Stopped::Enough, Some(draws)));
            }
            if crew.rows() >= most {
                return Ok((Stopped::MaxDraws, Some(draws)));
            }
            crew.memory.restore(draws);
        }
        check = ((check as f64 * schedule.growth).ceil() as usize).min(most);
    }
}

fn acceptance(blocks: &[Block], steps: usize) -> f64 {
    let walkers: usize = blocks.iter().map(|b| b.accepted.len()).sum();
    let moved: u64 = blocks.iter().flat_map(|b| &b.accepted).sum();
    moved as f64 / (walkers * steps).max(1) as f64
}

/// Acceptance rate of each chain over `steps`.
fn rates(totals: &[Block], steps: usize) -> Vec<f64> {
    let counts = totals.iter().flat_map(|b| &b.accepted);
    counts.map(|&n| n as f64 / steps.max(1) as f64).collect()
}

/// Adds the tallies of `blocks` to those of the run.
fn merge(totals: &mut Vec<Block>, blocks: &[Block]) {
    if totals.is_empty() {
        let tallies = |block: &Block| Block {
            accepted: block.accepted.clone(),
            moves: block.moves.clone(),
            nan: block.nan,
            evaluations: block.evaluations,
            ..Block::default()
        };
        totals.extend(blocks.iter().map(tallies));
        return;
    }
    for (total, block) in totals.iter_mut().zip(blocks) {
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

fn describe(draws: &mut Draws, totals: &[Block], steps: usize) {
    draws.info.acceptance = rates(totals, steps);
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
