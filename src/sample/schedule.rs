//! How much to run, when to stop, and who watches.

use super::EnsembleState;
use crate::chain::Draws;
use crate::error::{Error, Result};

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
    Sampling,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy)]
pub struct PhaseReport {
    pub phase: Phase,
    /// Steps of each ensemble so far.
    pub steps: u64,
    /// Draws stored so far, over all chains.
    pub draws: usize,
    /// Mean acceptance rate of the last block.
    pub acceptance: f64,
}

/// Watches a run; called between blocks, from the thread that called [`super::run`].
pub trait Monitor {
    /// Tells how far the run has come; `false` ends it here (a time limit, an interrupt).
    fn report(&self, report: &PhaseReport) -> bool;
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Monitor for Quiet {
    fn report(&self, _report: &PhaseReport) -> bool {
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
    /// Most draws held in memory, over all chains: of a longer run every second, fourth, ... is held, and diagnosed.
    pub memory: usize,
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
            memory: 1 << 19,
        }
    }
}

/// How much to run, when to stop, and who watches.
#[derive(Clone, Copy)]
pub struct Regime<'a> {
    pub schedule: &'a Schedule,
    pub stop: &'a dyn Stop,
    pub monitor: &'a dyn Monitor,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stopped {
    /// The stopping rule was satisfied.
    Enough,
    /// The most draws were stored first.
    MaxDraws,
    /// The progress callback ended it.
    Interrupted,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Draws after warm-up.
    pub draws: Draws,
    pub stopped: Stopped,
    /// Whether warm-up settled before its limit (true where its length was prescribed).
    pub settled: bool,
    /// The state of each ensemble, from which the run could go on.
    pub states: Vec<EnsembleState>,
}

impl Schedule {
    /// Check that the schedule makes sense.
    pub(super) fn check(&self) -> Result<()> {
        let growth = self.growth > 1.0 && self.growth.is_finite();
        if self.ensembles == 0 || self.warmup_windows == 0 || self.max_draws == 0 || !growth {
            return Err(Error::input(
                "schedule",
                "at least one ensemble, one warm-up window, one draw, and a growth above 1",
            )
            .found(format!("{self:?}")));
        }
        if self.thin == Some(0) {
            return Err(Error::input("thinning", "at least 1").found(0));
        }
        Ok(())
    }
}
