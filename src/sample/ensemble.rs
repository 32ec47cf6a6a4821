//! The ensemble sampler: two halves updated in turn, each with the other fixed (Foreman-Mackey et al. 2013,
//! Algorithm 3), and the one place where proposals are accepted or rejected.

use super::mixture::Mixture;
use super::moves::{Fit, Move, Others};
use super::stream::{Key, Stream};
use super::{Block, Sampler, Span, State};
use crate::chain::MoveTally;
use crate::error::{Error, Result};
use crate::infer::LogDensity;

/// Largest condition number of the scaled start positions, as in emcee's `walkers_independent`.
const CONDITION: f64 = 1e8;

/// Affine-invariant ensemble sampler with a mixture of moves.
#[derive(Default)]
pub struct Ensemble {
    /// The moves.
    pub mixture: Mixture,
    /// Walkers of an ensemble; by default the larger of 64 and 8 d, which keeps the fitted proposal close to the target.
    pub walkers: Option<usize>,
}

impl Ensemble {
    /// An ensemble of the default size with these moves.
    pub fn with(mixture: Mixture) -> Self {
        Self {
            mixture,
            walkers: None,
        }
    }
}

impl Sampler for Ensemble {
    fn name(&self) -> &'static str {
        "ensemble"
    }

    fn walkers(&self, dim: usize) -> usize {
        self.walkers.unwrap_or((8 * dim).max(64))
    }

    fn window(&self, dim: usize) -> usize {
        64.max(8 * dim)
    }

    fn begin(&self, dim: usize, x: Vec<f64>, lp: Vec<f64>, _covariance: &[f64]) -> Result<State> {
        let walkers = lp.len();
        let fewest = (2 * dim).max(2 * self.mixture.fewest(dim));
        if walkers < fewest || !walkers.is_multiple_of(2) {
            return Err(Error::input(
                "walkers",
                format!("an even number, at least {fewest} for {dim} parameters with these moves"),
            )
            .found(walkers));
        }
        let condition = condition(&x, dim);
        // Written so that NaN is refused too.
        if !matches!(
            condition.partial_cmp(&CONDITION),
            Some(std::cmp::Ordering::Less)
        ) {
            return Err(Error::input(
                "start of the walkers",
                format!("positions that span all {dim} dimensions (condition number below {CONDITION:e})"),
            )
            .found(format!("condition number {condition:e}"))
            .hint("an ensemble never leaves the subspace its walkers span: spread the start in every parameter"));
        }
        Ok(State {
            step: 0,
            x,
            lp,
            drawn: vec![0; walkers + 1],
            memory: Vec::new(),
        })
    }

    fn advance(&self, target: &dyn LogDensity, key: Key, span: Span, state: &mut State) -> Block {
        let (dim, walkers) = (target.dim(), state.lp.len());
        let mut streams: Vec<Stream> = (0..=walkers)
            .map(|lane| Stream::at(key, lane as u64, state.drawn[lane]))
            .collect();
        let mut scratch = Scratch::new(dim, walkers / 2);
        let mut block = self.block(walkers);
        let kept = span.steps / span.thin.max(1);
        block.x.reserve_exact(kept * walkers * dim);
        block.lp.reserve_exact(kept * walkers);
        for step in 1..=span.steps {
            let chosen = self.mixture.choose(streams[walkers].uniform());
            let kernel = &*self.mixture.parts()[chosen].0;
            for second in [false, true] {
                scratch.update(target, kernel, second, state, &mut streams);
                scratch.count(chosen, second, &mut block);
            }
            state.step += 1;
            if step.is_multiple_of(span.thin.max(1)) {
                block.x.extend_from_slice(&state.x);
                block.lp.extend_from_slice(&state.lp);
            }
        }
        for (drawn, stream) in state.drawn.iter_mut().zip(&streams) {
            *drawn = stream.used();
        }
        block
    }
}

impl Ensemble {
    fn block(&self, walkers: usize) -> Block {
        let tally = |kernel: &dyn Move| MoveTally {
            name: kernel.name().to_string(),
            proposed: 0,
            accepted: 0,
        };
        let parts = self.mixture.parts();
        Block {
            accepted: vec![0; walkers],
            moves: parts.iter().map(|(m, _)| tally(&**m)).collect(),
            ..Block::default()
        }
    }
}

/// Room for one half-step.
struct Scratch {
    dim: usize,
    half: usize,
    y: Vec<f64>,
    factor: Vec<f64>,
    lp: Vec<f64>,
    moved: Vec<bool>,
    evaluated: bool,
    nan: u64,
    fit: Fit,
}

impl Scratch {
    fn new(dim: usize, half: usize) -> Self {
        Self {
            dim,
            half,
            y: vec![0.0; half * dim],
            factor: vec![0.0; half],
            lp: vec![0.0; half],
            moved: vec![false; half],
            evaluated: false,
            nan: 0,
            fit: Fit::new(dim),
        }
    }

    /// Updates one half of the walkers with the other fixed.
    fn update(
        &mut self,
        target: &dyn LogDensity,
        kernel: &dyn Move,
        second: bool,
        state: &mut State,
        streams: &mut [Stream],
    ) {
        let dim = self.dim;
        let (a, b) = state.x.split_at_mut(self.half * dim);
        let (own, other) = if second { (b, a) } else { (a, b) };
        let first = if second { self.half } else { 0 };
        let streams = &mut streams[first..first + self.half];
        let lp = &mut state.lp[first..first + self.half];
        let others = Others::new(other, dim);
        self.nan = 0;
        self.moved.fill(false);
        self.evaluated = kernel.fit(others, &mut self.fit);
        if !self.evaluated {
            return;
        }
        let Self { y, factor, fit, .. } = self;
        kernel.propose_all(own, others, fit, streams, y, factor);
        target.log_density_batch(&self.y, &mut self.lp);
        for k in 0..self.half {
            let new = self.lp[k];
            self.nan += u64::from(new.is_nan() || new == f64::INFINITY);
            if accept(lp[k], new, self.factor[k], &mut streams[k]) {
                self.moved[k] = true;
                lp[k] = new;
                own[k * dim..(k + 1) * dim].copy_from_slice(&self.y[k * dim..(k + 1) * dim]);
            }
        }
    }

    fn count(&self, chosen: usize, second: bool, block: &mut Block) {
        let first = if second { self.half } else { 0 };
        let moved = self.moved.iter().filter(|&&m| m).count() as u64;
        block.moves[chosen].proposed += self.half as u64;
        block.moves[chosen].accepted += moved;
        block.nan += self.nan;
        block.evaluations += if self.evaluated { self.half as u64 } else { 0 };
        for (count, &moved) in block.accepted[first..].iter_mut().zip(&self.moved) {
            *count += u64::from(moved);
        }
    }
}

/// Metropolis-Hastings. NaN and +inf count as outside the support; a walker outside it accepts any point inside.
#[inline]
pub(crate) fn accept(old: f64, new: f64, factor: f64, rng: &mut Stream) -> bool {
    let uniform = rng.uniform();
    new.is_finite() && !factor.is_nan() && {
        let log_ratio = factor + new - old;
        log_ratio >= 0.0 || uniform < log_ratio.exp()
    }
}

/// Condition number of the walkers' centred positions, each column scaled to its norm (infinite if one is constant).
fn condition(x: &[f64], dim: usize) -> f64 {
    let mut columns = nalgebra::DMatrix::from_row_slice(x.len() / dim, dim, x);
    for mut column in columns.column_iter_mut() {
        let (mean, largest) = (column.mean(), column.amax());
        column.add_scalar_mut(-mean);
        let norm = column.norm();
        // Rounding of the mean alone must not count as spread; NaN must not either.
        if !matches!(
            norm.partial_cmp(&(1e-14 * largest)),
            Some(std::cmp::Ordering::Greater)
        ) {
            return f64::INFINITY;
        }
        column /= norm;
    }
    let values = columns.singular_values();
    values.max() / values.min()
}
