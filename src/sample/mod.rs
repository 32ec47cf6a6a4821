//! Samplers: kernels that advance a state under a target, and the schedule that runs independent ensembles of them.
//!
//! A [`Sampler`] has no state of its own. What the next step needs is in [`EnsembleState`]; what is worth knowing about the
//! steps taken is in [`Block`]. Every random number comes from a [`Stream`] that is known from (seed, ensemble, walker,
//! count), so the draws depend neither on the number of threads nor on where a run was interrupted.

mod adapted;
mod adaptive;
mod checkpoint;
mod de;
mod density;
mod ensemble;
mod gaussian;
mod independence;
mod keep;
mod laplace;
pub mod memory;
mod mixture;
mod moves;
mod numbers;
mod run;
mod schedule;
mod snooker;
mod start;
pub mod stream;
mod stretch;

pub use adapted::{Adapted, NormalPart, POOR, adapted};
pub use adaptive::Adaptive;
pub use checkpoint::{Checkpoint, Warm};
pub use de::De;
pub use density::{DensityError, FunctionDensity, LogDensity, density};
pub use ensemble::Ensemble;
pub use independence::Independence;
pub use keep::Keeping;
pub use laplace::{Laplace, laplace};
pub use mixture::{MOVES, Mixture};
pub use moves::{Fit, Move, Proposal, Walkers};
pub use numbers::{Needs, Numbers};
pub use run::{run, run_kept};
pub use schedule::{Monitor, Outcome, Phase, PhaseReport, Quiet, Regime, Schedule, Stop, Stopped};
pub use snooker::Snooker;
pub use start::Start;
pub use stream::{Key, Stream};
pub use stretch::Stretch;

use serde::{Deserialize, Serialize};

use crate::chain::MoveTally;
use crate::error::Result;

/// What the next step of one ensemble needs, and nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EnsembleState {
    pub step: u64,
    /// Positions, walker x parameter.
    pub x: Vec<f64>,
    /// Log density of each walker.
    pub lp: Vec<f64>,
    /// Place that the random streams have reached.
    pub drawn: u64,
    /// What the sampler has learned, in an order of its own.
    pub memory: Vec<f64>,
}

impl EnsembleState {
    /// Before the first step: walkers at `x` (walker x parameter) with log densities `lp`, and what the sampler knows already.
    pub fn start(x: Vec<f64>, lp: Vec<f64>, memory: Vec<f64>) -> Self {
        Self {
            step: 0,
            x,
            lp,
            drawn: 0,
            memory,
        }
    }
}

/// A stretch of steps to take.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    pub steps: usize,
    /// Keep the state after every `thin`-th step; at least 1.
    pub thin: usize,
    /// Whether the sampler may adapt. Its draws are then not of the target.
    pub warmup: bool,
}

/// What one ensemble did over a span.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Block {
    /// Kept positions, draw x parameter x walker.
    #[serde(skip)]
    pub x: Vec<f64>,
    /// Kept log densities, draw x walker.
    #[serde(skip)]
    pub lp: Vec<f64>,
    /// Steps in which each walker moved.
    pub accepted: Vec<u64>,
    pub moves: Vec<MoveTally>,
    /// Evaluations that gave NaN or +inf.
    pub nan: u64,
    pub evaluations: u64,
}

impl Block {
    /// Empties it for a span of `walkers` walkers with these moves; its memory is used again.
    fn begin<'a>(&mut self, walkers: usize, moves: impl Iterator<Item = &'a str>) {
        self.x.clear();
        self.lp.clear();
        self.accepted.clear();
        self.accepted.resize(walkers, 0);
        let tally = |name: &str| MoveTally {
            name: name.to_string(),
            proposed: 0,
            accepted: 0,
        };
        self.moves = moves.map(tally).collect();
        (self.nan, self.evaluations) = (0, 0);
    }
}

/// A Markov kernel on ensembles of walkers (of one walker for a sampler of single chains).
pub trait Sampler: Send + Sync {
    /// Canonical name (`ensemble`).
    fn name(&self) -> &'static str;

    /// Walkers of one ensemble in `dim` dimensions.
    fn walkers(&self, dim: usize) -> usize;

    /// Steps of the first warm-up window, and of the first block after it.
    fn window(&self, dim: usize) -> usize;

    /// Checks walkers `x` (walker x parameter) whose log densities are `lp`, and makes a state of them. `covariance`
    /// (dim x dim) is a guess of the target's.
    ///
    /// # Errors
    /// The input's fault: a degenerate start, or too few walkers.
    fn begin(
        &self,
        dim: usize,
        x: Vec<f64>,
        lp: Vec<f64>,
        covariance: &[f64],
    ) -> Result<EnsembleState>;

    /// Advances `state` by a span of steps; `block` takes what was done, whatever it held before. The same key, state
    /// and span give the same block and the same new state.
    ///
    /// # Errors
    /// Fatal ones of the target.
    fn advance(
        &self,
        target: &dyn LogDensity,
        key: Key,
        span: Span,
        state: &mut EnsembleState,
        block: &mut Block,
    ) -> Result<()>;
}

/// A sampler by name.
pub struct SamplerEntry {
    /// Canonical name.
    pub name: &'static str,
    /// The sampler with its default constants.
    pub build: fn() -> Box<dyn Sampler>,
}

/// Every sampler. A new one is one file and one line here.
pub static SAMPLERS: &[SamplerEntry] = &[
    SamplerEntry {
        name: "ensemble",
        build: || Box::new(Ensemble::default()),
    },
    SamplerEntry {
        name: "adaptive",
        build: || Box::new(Adaptive::default()),
    },
];
