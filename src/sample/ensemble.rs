//! The ensemble sampler: two halves updated in turn, each with the other fixed (Foreman-Mackey et al. 2013,
//! Algorithm 3), and the one place where proposals are accepted or rejected.

use pulp::{Simd, WithSimd};

use super::density::LogDensity;
use super::gaussian::singular_values;
use super::mixture::Mixture;
use super::moves::{Fit, Move, Proposal, Walkers};
use super::numbers::Numbers;
use super::stream::{Key, Stream};
use super::{Block, EnsembleState, Sampler, Span};
use crate::error::{Error, Result};

/// Largest condition number of the scaled start positions, as in emcee's `walkers_independent`.
const CONDITION: f64 = 1e8;

/// Affine-invariant ensemble sampler with a mixture of moves.
#[derive(Default)]
pub struct Ensemble {
    pub mixture: Mixture,
    /// Walkers of an ensemble; by default the larger of 64 and 8 d, which keeps the fitted proposal close to the target.
    pub walkers: Option<usize>,
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

    fn begin(&self, dim: usize, x: Vec<f64>, lp: Vec<f64>, _: &[f64]) -> Result<EnsembleState> {
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
        Ok(EnsembleState::start(x, lp, Vec::new()))
    }

    fn advance(
        &self,
        target: &dyn LogDensity,
        key: Key,
        span: Span,
        state: &mut EnsembleState,
        block: &mut Block,
    ) -> Result<()> {
        let (dim, walkers) = (target.dim(), state.lp.len());
        let mut halves = Half::split(state, dim);
        let mut scratch = Scratch::new(dim, walkers / 2);
        let parts = self.mixture.parts();
        block.begin(walkers, parts.iter().map(|(kernel, _)| kernel.name()));
        let kept = span.steps / span.thin.max(1);
        block.x.reserve_exact(kept * walkers * dim);
        block.lp.reserve_exact(kept * walkers);
        for step in 1..=span.steps {
            let mut own = Stream::at(key, walkers as u64, 2 * state.drawn);
            let chosen = self.mixture.choose(own.uniform());
            let kernel = &*parts[chosen].0;
            let needs = kernel.needs(dim, walkers / 2);
            for moving in 0..2 {
                let first = (moving * walkers / 2) as u64;
                scratch.numbers.draw(key, first, state.drawn, needs);
                scratch.update(target, kernel, &mut halves, moving)?;
                scratch.count(chosen, moving, block);
            }
            state.drawn += needs.places() as u64;
            state.step += 1;
            if step.is_multiple_of(span.thin.max(1)) {
                Half::keep(&halves, block);
            }
        }
        Half::join(&halves, state);
        Ok(())
    }
}

/// One half of the walkers, parameter by parameter.
struct Half {
    x: Vec<f64>,
    lp: Vec<f64>,
}

impl Half {
    fn split(state: &EnsembleState, dim: usize) -> [Self; 2] {
        let half = state.lp.len() / 2;
        [0, half].map(|first| Self {
            x: (0..dim * half)
                .map(|at| state.x[(first + at % half) * dim + at / half])
                .collect(),
            lp: state.lp[first..first + half].to_vec(),
        })
    }

    fn join(halves: &[Self; 2], state: &mut EnsembleState) {
        let half = state.lp.len() / 2;
        let dim = state.x.len() / state.lp.len();
        for (which, own) in halves.iter().enumerate() {
            let first = which * half;
            state.lp[first..first + half].copy_from_slice(&own.lp);
            for (at, value) in own.x.iter().enumerate() {
                state.x[(first + at % half) * dim + at / half] = *value;
            }
        }
    }

    fn keep([a, b]: &[Self; 2], block: &mut Block) {
        for (a, b) in a.walkers().columns().zip(b.walkers().columns()) {
            block.x.extend_from_slice(a);
            block.x.extend_from_slice(b);
        }
        block.lp.extend_from_slice(&a.lp);
        block.lp.extend_from_slice(&b.lp);
    }

    fn walkers(&self) -> Walkers<'_> {
        Walkers::new(&self.x, self.lp.len())
    }
}

/// Room for one half-step.
struct Scratch {
    y: Vec<f64>,
    factor: Vec<f64>,
    lp: Vec<f64>,
    /// 1 for each walker that moved.
    moved: Vec<f64>,
    evaluated: bool,
    nan: u64,
    fit: Fit,
    numbers: Numbers,
}

impl Scratch {
    fn new(dim: usize, half: usize) -> Self {
        Self {
            y: vec![0.0; half * dim],
            factor: vec![0.0; half],
            lp: vec![0.0; half],
            moved: vec![0.0; half],
            evaluated: false,
            nan: 0,
            fit: Fit::new(dim),
            numbers: Numbers::new(half),
        }
    }

    /// Updates the `moving` half of the walkers with the other fixed.
    fn update(
        &mut self,
        target: &dyn LogDensity,
        kernel: &dyn Move,
        halves: &mut [Half; 2],
        moving: usize,
    ) -> Result<()> {
        let [a, b] = halves;
        let (own, others) = if moving == 0 { (a, &*b) } else { (b, &*a) };
        self.nan = 0;
        self.moved.fill(0.0);
        self.evaluated = kernel.fit(others.walkers(), &mut self.fit);
        if !self.evaluated {
            return Ok(());
        }
        kernel.propose(Proposal {
            own: own.walkers(),
            others: others.walkers(),
            fit: &self.fit,
            numbers: &self.numbers,
            y: &mut self.y,
            factor: &mut self.factor,
        });
        target.values(&self.y, &mut self.lp)?;
        pulp::Arch::new().dispatch(Settle { own, scratch: self });
        Ok(())
    }

    fn count(&self, chosen: usize, moving: usize, block: &mut Block) {
        let half = self.moved.len();
        let moved = self.moved.iter().sum::<f64>() as u64;
        block.moves[chosen].proposed += half as u64;
        block.moves[chosen].accepted += moved;
        block.nan += self.nan;
        block.evaluations += if self.evaluated { half as u64 } else { 0 };
        for (count, &moved) in block.accepted[moving * half..].iter_mut().zip(&self.moved) {
            *count += moved as u64;
        }
    }
}

/// Accepts or rejects the proposals of a half, in vectors.
struct Settle<'a> {
    own: &'a mut Half,
    scratch: &'a mut Scratch,
}

impl WithSimd for Settle<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { own, scratch } = self;
        let count = own.lp.len();
        let (new, factor) = (&scratch.lp[..count], &scratch.factor[..count]);
        let uniforms = &scratch.numbers.log_uniform()[..count];
        let (old, moved) = (&mut own.lp[..count], &mut scratch.moved[..count]);
        let mut nan = 0;
        for k in 0..count {
            nan += u64::from(new[k].is_nan() | (new[k] == f64::INFINITY));
            let accepted = accept(old[k], new[k], factor[k], uniforms[k]);
            moved[k] = f64::from(accepted);
            old[k] = if accepted { new[k] } else { old[k] };
        }
        scratch.nan = nan;
        let columns = own.x.chunks_exact_mut(count);
        for (x, y) in columns.zip(scratch.y.chunks_exact(count)) {
            // In vectors by hand: the compiler makes branches of the choice.
            let (moved, moved_rest) = S::as_simd_f64s(moved);
            let (x, x_rest) = S::as_mut_simd_f64s(x);
            let (y, y_rest) = S::as_simd_f64s(y);
            for ((x, y), moved) in x.iter_mut().zip(y).zip(moved) {
                let mask = simd.less_than_f64s(simd.splat_f64s(0.0), *moved);
                *x = simd.select_f64s(mask, *y, *x);
            }
            for ((x, y), moved) in x_rest.iter_mut().zip(y_rest).zip(moved_rest) {
                *x = if *moved > 0.0 { *y } else { *x };
            }
        }
    }
}

/// Metropolis-Hastings, with the logarithm of a uniform number on (0, 1]. NaN and +inf count as outside the support; a
/// walker outside it accepts any point inside.
#[inline(always)]
pub(crate) fn accept(old: f64, new: f64, factor: f64, log_uniform: f64) -> bool {
    new.is_finite() & (log_uniform <= factor + new - old)
}

/// Condition number of the walkers' centred positions, each column scaled to its norm (infinite if one is constant).
fn condition(x: &[f64], dim: usize) -> f64 {
    let walkers = x.len() / dim;
    let mut columns = Vec::with_capacity(x.len());
    for k in 0..dim {
        let column = x.iter().skip(k).step_by(dim);
        let mean = column.clone().sum::<f64>() / walkers as f64;
        let largest = column.clone().fold(0.0, |a: f64, v| a.max(v.abs()));
        let first = columns.len();
        columns.extend(column.map(|v| v - mean));
        let norm = columns[first..].iter().map(|v| v * v).sum::<f64>().sqrt();
        // Rounding of the mean alone must not count as spread; NaN must not either.
        if !matches!(
            norm.partial_cmp(&(1e-14 * largest)),
            Some(std::cmp::Ordering::Greater)
        ) {
            return f64::INFINITY;
        }
        columns[first..].iter_mut().for_each(|v| *v /= norm);
    }
    let values = singular_values(columns, walkers);
    let largest = values.iter().copied().fold(0.0, f64::max);
    largest / values.into_iter().fold(f64::INFINITY, f64::min)
}
