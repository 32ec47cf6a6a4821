//! Adaptive Metropolis, Haario, Saksman & Tamminen (2001), Bernoulli 7, 223, with delayed rejection, Haario, Laine,
//! Mira & Saksman (2006), Stat. Comput. 16, 339. Adaptation is frozen after warm-up, so the kept draws are of an
//! ordinary Markov chain.

use super::density::{DensityError, LogDensity};
use super::ensemble::accept;
use super::gaussian::{add_lower, cholesky, whiten};
use super::stream::{Key, Stream};
use super::{Block, EnsembleState, Sampler, Span};
use crate::error::{Error, Result};

/// Steps between two updates of the proposal during warm-up.
const REFRESH: u64 = 20;

/// Adaptive Metropolis on single chains.
#[derive(Debug, Clone, Copy)]
pub struct Adaptive {
    /// Regularisation of the covariance, relative to the guessed one (the paper's epsilon, made scale-free).
    pub epsilon: f64,
    /// Scale of the second-stage proposal relative to the first; 0 turns delayed rejection off.
    pub second: f64,
}

impl Default for Adaptive {
    fn default() -> Self {
        Self {
            epsilon: 1e-10,
            second: 0.2,
        }
    }
}

/// Layout of the memory: two accumulators of the history (count, mean, scatter), the guessed variances and the
/// Cholesky factor in use. The first accumulator spans at least the last half of the warm-up, the second is the one
/// that will replace it, so the transient of the start is forgotten.
struct History<'a> {
    long: &'a mut [f64],
    short: &'a mut [f64],
    guess: &'a mut [f64],
    lower: &'a mut [f64],
}

impl<'a> History<'a> {
    fn room(dim: usize) -> usize {
        2 * (1 + dim + dim * dim) + dim + dim * dim
    }

    fn of(memory: &'a mut [f64], dim: usize) -> Self {
        let (long, rest) = memory.split_at_mut(1 + dim + dim * dim);
        let (short, rest) = rest.split_at_mut(1 + dim + dim * dim);
        let (guess, lower) = rest.split_at_mut(dim);
        Self {
            long,
            short,
            guess,
            lower,
        }
    }

    /// Adds a point to both accumulators (Welford).
    fn add(&mut self, x: &[f64]) {
        for part in [&mut *self.long, &mut *self.short] {
            let dim = x.len();
            let (count, rest) = part.split_at_mut(1);
            let (mean, scatter) = rest.split_at_mut(dim);
            count[0] += 1.0;
            for i in 0..dim {
                let before = x[i] - mean[i];
                mean[i] += before / count[0];
                for j in 0..=i {
                    // For j < i mean[j] is already the new one, as Welford's update needs.
                    scatter[i * dim + j] += before * (x[j] - mean[j]);
                }
            }
        }
    }

    /// Renews the proposal from the history; keeps the old one while there is too little of it.
    fn refresh(&mut self, epsilon: f64, work: &mut [f64]) {
        let dim = self.guess.len();
        let count = self.long[0];
        if count < 20.0 * dim as f64 {
            return;
        }
        let scatter = &self.long[1 + dim..];
        let scale = 2.38 * 2.38 / dim as f64;
        for i in 0..dim {
            for j in 0..=i {
                work[i * dim + j] = scale * scatter[i * dim + j] / (count - 1.0);
            }
            work[i * dim + i] += scale * epsilon * self.guess[i];
        }
        if cholesky(work, dim) {
            self.lower.copy_from_slice(work);
        }
    }

    /// Forgets the first half of the history whenever its length reaches a power of two.
    fn forget(&mut self, step: u64) {
        if step.is_power_of_two() {
            self.long.copy_from_slice(self.short);
            self.short.fill(0.0);
        }
    }
}

impl Sampler for Adaptive {
    fn name(&self) -> &'static str {
        "adaptive"
    }

    fn walkers(&self, _dim: usize) -> usize {
        1
    }

    fn window(&self, dim: usize) -> usize {
        (500 * dim).max(2000)
    }

    fn begin(
        &self,
        dim: usize,
        x: Vec<f64>,
        lp: Vec<f64>,
        covariance: &[f64],
    ) -> Result<EnsembleState> {
        if lp.len() != 1 {
            return Err(Error::program("adaptive", "one walker").found(lp.len()));
        }
        let mut memory = vec![0.0; History::room(dim)];
        let parts = History::of(&mut memory, dim);
        let scale = 2.38 * 2.38 / dim as f64;
        for i in 0..dim {
            parts.guess[i] = covariance[i * dim + i];
        }
        for (lower, c) in parts.lower.iter_mut().zip(covariance) {
            *lower = scale * c;
        }
        if !cholesky(parts.lower, dim) {
            return Err(Error::input(
                "start covariance",
                "a positive definite matrix",
            ));
        }
        Ok(EnsembleState::start(x, lp, memory))
    }

    fn advance(
        &self,
        target: &dyn LogDensity,
        key: Key,
        span: Span,
        state: &mut EnsembleState,
        block: &mut Block,
    ) -> Result<()> {
        let dim = target.dim();
        let mut rng = Stream::at(key, 0, state.drawn);
        block.begin(1, STAGES.into_iter());
        let mut trial = Trial::new(dim);
        let mut work = vec![0.0; dim * dim];
        for step in 1..=span.steps {
            let memory = History::of(&mut state.memory, dim);
            let at = (&mut *state.x, &mut state.lp[0]);
            let moved = self.step(target, memory.lower, at, &mut trial, &mut rng)?;
            block.accepted[0] += u64::from(moved);
            state.step += 1;
            if span.warmup {
                let mut memory = History::of(&mut state.memory, dim);
                memory.add(&state.x);
                memory.forget(state.step);
                if state.step.is_multiple_of(REFRESH) {
                    memory.refresh(self.epsilon, &mut work);
                }
            }
            if step.is_multiple_of(span.thin.max(1)) {
                block.x.extend_from_slice(&state.x);
                block.lp.extend_from_slice(&state.lp);
            }
        }
        state.drawn = rng.used();
        trial.tally.put(block);
        Ok(())
    }
}

/// Names of the two proposals of a step.
const STAGES: [&str; 2] = ["metropolis", "delayed"];

/// Room for the two proposals of a step.
struct Trial {
    first: Vec<f64>,
    second: Vec<f64>,
    z: Vec<f64>,
    r: Vec<f64>,
    tally: Tally,
}

impl Trial {
    fn new(dim: usize) -> Self {
        Self {
            first: vec![0.0; dim],
            second: vec![0.0; dim],
            z: vec![0.0; dim],
            r: vec![0.0; dim],
            tally: Tally::default(),
        }
    }
}

#[derive(Default)]
struct Tally {
    proposed: [u64; 2],
    accepted: [u64; 2],
    nan: u64,
}

impl Tally {
    fn put(&self, block: &mut Block) {
        for (k, stage) in block.moves.iter_mut().enumerate() {
            (stage.proposed, stage.accepted) = (self.proposed[k], self.accepted[k]);
        }
        block.nan = self.nan;
        block.evaluations = self.proposed.iter().sum();
    }

    /// The log density at a proposal, -inf where it is NaN or +inf.
    fn evaluate(&mut self, target: &dyn LogDensity, x: &[f64], stage: usize) -> Result<f64> {
        self.proposed[stage] += 1;
        match target.log_density(x) {
            Ok(value) => Ok(value),
            Err(DensityError::Fatal(error)) => Err(error),
            Err(DensityError::Outside) => Ok(f64::NEG_INFINITY),
            Err(DensityError::Undefined(_)) => {
                self.nan += 1;
                Ok(f64::NEG_INFINITY)
            }
        }
    }
}

impl Adaptive {
    /// One step from `(x, lp)`; whether it moved.
    fn step(
        &self,
        target: &dyn LogDensity,
        lower: &[f64],
        (x, lp): (&mut [f64], &mut f64),
        trial: &mut Trial,
        rng: &mut Stream,
    ) -> Result<bool> {
        trial.z.iter_mut().for_each(|z| *z = rng.normal());
        trial.first.copy_from_slice(x);
        add_lower(lower, &trial.z, 1.0, &mut trial.first);
        let first = trial.tally.evaluate(target, &trial.first, 0)?;
        if accept(*lp, first, 0.0, rng.log_uniform()) {
            x.copy_from_slice(&trial.first);
            *lp = first;
            trial.tally.accepted[0] += 1;
            return Ok(true);
        }
        if self.second <= 0.0 {
            return Ok(false);
        }
        // Second stage. From x the first proposal y1 had the whitened step z; from y2 it would have had r.
        let from_x: f64 = trial.z.iter().map(|z| z * z).sum();
        trial.z.iter_mut().for_each(|z| *z = rng.normal());
        trial.second.copy_from_slice(x);
        add_lower(lower, &trial.z, self.second, &mut trial.second);
        let second = trial.tally.evaluate(target, &trial.second, 1)?;
        for k in 0..x.len() {
            trial.r[k] = trial.first[k] - trial.second[k];
        }
        let from_second = whiten(lower, &mut trial.r);
        // log of q1(y2 -> y1) (1 - a1(y2, y1)) / (q1(x -> y1) (1 - a1(x, y1))): Haario et al. 2006, Eq. 3.
        let factor =
            0.5 * (from_x - from_second) + log_refused(second, first) - log_refused(*lp, first);
        if accept(*lp, second, factor, rng.log_uniform()) {
            x.copy_from_slice(&trial.second);
            *lp = second;
            trial.tally.accepted[1] += 1;
            return Ok(true);
        }
        Ok(false)
    }
}

/// log(1 - min(1, exp(new - old))), -inf where the move is certain.
fn log_refused(old: f64, new: f64) -> f64 {
    if new == f64::NEG_INFINITY {
        0.0
    } else if new >= old {
        f64::NEG_INFINITY
    } else {
        (-(new - old).exp_m1()).ln()
    }
}
