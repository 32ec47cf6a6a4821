//! Sampling what is almost known: a mixture of normals near the target is weighed against it at some draws, a Student-t takes the mean and
//! the covariance that they have by their weights (population Monte Carlo: Cappe, Guillin, Marin and Robert 2004, J. Comput. Graph. Stat. 13,
//! 907), and proposals from that, which depend on no walker, are accepted by the ratio of their weights (independence Metropolis: Tierney
//! 1994, Ann. Stat. 22, 1701).

use rayon::prelude::*;

use super::density::LogDensity;
use super::ensemble::accept;
use super::gaussian::{add_lower, cholesky, whiten};
use super::stream::{Key, Stream};
use super::{Block, EnsembleState, Sampler, Span};
use crate::error::{Error, Result};
use crate::numeric::{log_sum_exp, relative_weights};

/// A normal distribution of some weight.
#[derive(Debug)]
pub struct NormalPart {
    pub log_weight: f64,
    pub mean: Vec<f64>,
    /// dim x dim, row-major.
    pub covariance: Vec<f64>,
}

/// Independent proposals from a Student-t that was fitted to the target.
#[derive(Debug)]
pub struct Adapted {
    student: Student,
    /// Draws of it with their weights, at which chains start.
    starts: WeighedDraws,
}

/// Draws of the first guess, and of each Student-t that is tried.
const GUESSED: usize = 2000;
const TRIED: usize = 500;

/// Student-t distributions that are tried, each fitted to the draws of the one before: far from the target each goes a part of the way.
const ROUNDS: usize = 12;

/// Effective draws that a covariance is taken from, at least: where there are fewer, of weights to a power below 1.
const ENOUGH: f64 = 50.0;

/// Halvings of the range in which that power is sought.
const HALVINGS: usize = 40;

/// Effective share of its draws below which a proposal is poor.
pub const POOR: f64 = 0.3;

/// The share at which no better one is sought.
const GOOD: f64 = 0.7;

/// Degrees of freedom: its tails are heavier than the target's, at a loss of a twelfth of the draws.
const DOF: usize = 8;

/// Walkers of an ensemble, each a chain that depends on no other, and steps of a window.
const WALKERS: usize = 8;
const WINDOW: usize = 64;

/// Fit proposals to a target from a first guess, with numbers of the streams of a key: the effective share of the last ones that were
/// tried, and the sampler, if they are not poor.
///
/// # Errors
/// Fatal ones of the target.
pub fn adapted(
    target: &dyn LogDensity,
    guess: &[NormalPart],
    key: Key,
) -> Result<(f64, Option<Adapted>)> {
    let guess = Guess::new(guess, target.dim());
    if guess.parts.is_empty() {
        return Ok((0.0, None));
    }
    let stream = |k: usize| Stream::at(key, k as u64, 0);
    let drawn = (0..GUESSED).map(|k| guess.draw(&mut stream(k)));
    let mut found = WeighedDraws::new(target, drawn.collect())?;
    let mut best: (f64, Option<Adapted>) = (0.0, None);
    for round in 0..ROUNDS {
        let Some(student) = found.student(&found.tempered()) else {
            break;
        };
        let first = GUESSED + round * TRIED;
        let drawn = (first..first + TRIED).map(|k| student.draw(&mut stream(k)));
        found = WeighedDraws::new(target, drawn.collect())?;
        let share = found.share();
        if share > best.0 {
            let starts = found.clone();
            best = (share, Some(Adapted { student, starts }));
        } else if best.0 >= POOR {
            break;
        }
        if share >= GOOD {
            break;
        }
    }
    let (share, sampler) = best;
    Ok((share, sampler.filter(|_| share >= POOR)))
}

/// Draws with what they weigh under the target.
#[derive(Debug, Clone)]
struct WeighedDraws {
    points: Vec<Vec<f64>>,
    /// Over the largest.
    weights: Vec<f64>,
}

impl WeighedDraws {
    /// Of points with the logarithm of the density of which they were drawn, but for a constant.
    fn new(target: &dyn LogDensity, drawn: Vec<(Vec<f64>, f64)>) -> Result<Self> {
        /// Points that are asked for at once.
        const BATCH: usize = 250;
        let of = |batch: &[(Vec<f64>, f64)]| -> Result<Vec<f64>> {
            let by_parameter = (0..target.dim()).flat_map(|k| batch.iter().map(move |(x, _)| x[k]));
            let mut values = vec![0.0; batch.len()];
            target.values(&by_parameter.collect::<Vec<f64>>(), &mut values)?;
            let ratio = |(value, (_, log_q)): (f64, &(Vec<f64>, f64))| match value.is_finite() {
                true => value - log_q,
                false => f64::NEG_INFINITY,
            };
            Ok(values.into_iter().zip(batch).map(ratio).collect())
        };
        let batches = drawn.par_chunks(BATCH).map(of);
        let logs: Vec<f64> = batches.collect::<Result<Vec<Vec<f64>>>>()?.concat();
        Ok(Self {
            points: drawn.into_iter().map(|(x, _)| x).collect(),
            weights: match logs.iter().all(|l| *l == f64::NEG_INFINITY) {
                true => vec![0.0; logs.len()],
                false => relative_weights(&logs),
            },
        })
    }

    /// Effective share of the draws.
    fn share(&self) -> f64 {
        effective(&self.weights) / self.weights.len() as f64
    }

    /// Their weights to the largest power up to 1 at which [`ENOUGH`] of them are effective (nonlinear importance weights: Koblents and Miguez
    /// 2015, Stat. Comput. 25, 407).
    fn tempered(&self) -> Vec<f64> {
        let to = |power: f64| -> Vec<f64> { self.weights.iter().map(|w| w.powf(power)).collect() };
        if effective(&self.weights) >= ENOUGH {
            return self.weights.clone();
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match effective(&to(middle)) >= ENOUGH {
                true => low = middle,
                false => high = middle,
            }
        }
        to(low)
    }

    /// The Student-t of their mean and covariance by some weights; none where that is not positive definite.
    fn student(&self, weights: &[f64]) -> Option<Student> {
        let dim = self.points.first()?.len();
        let sum: f64 = weights.iter().sum();
        let weighed = || self.points.iter().zip(weights);
        let mean: Vec<f64> = (0..dim)
            .map(|k| weighed().map(|(x, w)| w * x[k]).sum::<f64>() / sum)
            .collect();
        let product = |i: usize, j: usize| -> f64 {
            let terms = weighed().map(|(x, w)| w * (x[i] - mean[i]) * (x[j] - mean[j]));
            terms.sum::<f64>() / sum
        };
        let pairs = (0..dim).flat_map(|i| (0..dim).map(move |j| (i, j)));
        let covariance: Vec<f64> = pairs.map(|(i, j)| product(i, j)).collect();
        let mut lower = covariance.clone();
        cholesky(&mut lower, dim).then_some(Student {
            mean,
            covariance,
            lower,
        })
    }

    /// One of the draws by its weight.
    fn pick(&self, rng: &mut Stream) -> Vec<f64> {
        self.points[picked(&self.weights, rng)].clone()
    }
}

/// How many draws of equal weight say as much: (sum w)^2 / sum w^2.
fn effective(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    match squares > 0.0 {
        true => sum * sum / squares,
        false => 0.0,
    }
}

/// An index by its weight.
fn picked(weights: &[f64], rng: &mut Stream) -> usize {
    let mut left = rng.uniform() * weights.iter().sum::<f64>();
    let place = weights.iter().position(|w| {
        left -= w;
        left < 0.0
    });
    place.unwrap_or(0)
}

/// The first guess.
struct Guess<'a> {
    parts: Vec<(&'a NormalPart, Vec<f64>)>,
    /// Probabilities of the parts.
    weights: Vec<f64>,
}

impl<'a> Guess<'a> {
    /// Of those parts whose covariances are positive definite.
    fn new(parts: &'a [NormalPart], dim: usize) -> Self {
        let factor = |part: &'a NormalPart| {
            let mut lower = part.covariance.clone();
            (lower.len() == dim * dim && cholesky(&mut lower, dim)).then_some((part, lower))
        };
        let parts: Vec<(&NormalPart, Vec<f64>)> = parts.iter().filter_map(factor).collect();
        let logs: Vec<f64> = parts.iter().map(|(p, _)| p.log_weight).collect();
        Self {
            weights: relative_weights(&logs),
            parts,
        }
    }

    /// A point with its log density; there is a part at least.
    fn draw(&self, rng: &mut Stream) -> (Vec<f64>, f64) {
        let last = self.parts.len() - 1;
        let (part, lower) = &self.parts[picked(&self.weights, rng).min(last)];
        let z: Vec<f64> = part.mean.iter().map(|_| rng.normal()).collect();
        let mut x = part.mean.clone();
        add_lower(lower, &z, 1.0, &mut x);
        let log = |((part, lower), weight): (&(&NormalPart, Vec<f64>), &f64)| {
            let dim = x.len();
            let log_det: f64 = (0..dim).map(|k| lower[k * (dim + 1)].ln()).sum();
            weight.ln() - log_det - 0.5 * distance2(lower, &part.mean, &x)
        };
        let log_q = log_sum_exp(self.parts.iter().zip(&self.weights).map(log));
        (x, log_q)
    }
}

/// |L^-1 (x - mean)|^2.
fn distance2(lower: &[f64], mean: &[f64], x: &[f64]) -> f64 {
    let mut r: Vec<f64> = x.iter().zip(mean).map(|(x, m)| x - m).collect();
    whiten(lower, &mut r)
}

/// A Student-t of [`DOF`] degrees of freedom.
#[derive(Debug)]
struct Student {
    mean: Vec<f64>,
    /// Its shape, and the lower factor of that.
    covariance: Vec<f64>,
    lower: Vec<f64>,
}

impl Student {
    fn log_density(&self, x: &[f64]) -> f64 {
        let square = distance2(&self.lower, &self.mean, x);
        -0.5 * (DOF + x.len()) as f64 * (square / DOF as f64).ln_1p()
    }

    /// A point with its log density.
    fn draw(&self, rng: &mut Stream) -> (Vec<f64>, f64) {
        let z: Vec<f64> = self.mean.iter().map(|_| rng.normal()).collect();
        let chi2: f64 = (0..DOF).map(|_| rng.normal().powi(2)).sum();
        let mut x = self.mean.clone();
        add_lower(&self.lower, &z, (DOF as f64 / chi2).sqrt(), &mut x);
        let log_q = self.log_density(&x);
        (x, log_q)
    }
}

impl Adapted {
    /// Where a walker starts.
    pub fn place(&self, rng: &mut Stream) -> Vec<f64> {
        self.starts.pick(rng)
    }

    /// The shape of the proposals, dim x dim.
    pub fn covariance(&self) -> &[f64] {
        &self.student.covariance
    }
}

impl Sampler for Adapted {
    fn name(&self) -> &'static str {
        "independence"
    }

    fn walkers(&self, _dim: usize) -> usize {
        WALKERS
    }

    fn window(&self, _dim: usize) -> usize {
        WINDOW
    }

    fn begin(&self, _dim: usize, x: Vec<f64>, lp: Vec<f64>, _: &[f64]) -> Result<EnsembleState> {
        if lp.len() != WALKERS {
            let expected = format!("{WALKERS} walkers");
            return Err(Error::program("independence", expected).found(lp.len()));
        }
        Ok(EnsembleState::start(x, lp, Vec::new()))
    }

    /// All proposals of a span are evaluated at once: none depends on where the walkers are.
    fn advance(
        &self,
        target: &dyn LogDensity,
        key: Key,
        span: Span,
        state: &mut EnsembleState,
        block: &mut Block,
    ) -> Result<()> {
        let (dim, count) = (target.dim(), span.steps * WALKERS);
        let mut rng = Stream::at(key, 0, state.drawn);
        block.begin(WALKERS, [self.name()].into_iter());
        let mut xs = vec![0.0; dim * count];
        let mut proposed = Vec::with_capacity(count);
        for i in 0..count {
            let (x, log_q) = self.student.draw(&mut rng);
            x.iter()
                .enumerate()
                .for_each(|(k, x)| xs[k * count + i] = *x);
            proposed.push((log_q, rng.log_uniform()));
        }
        let mut values = vec![0.0; count];
        target.values(&xs, &mut values)?;
        let walkers = state.x.chunks_exact(dim);
        let mut own: Vec<f64> = walkers.map(|x| self.student.log_density(x)).collect();
        for (i, (&value, (log_q, chance))) in values.iter().zip(proposed).enumerate() {
            let w = i % WALKERS;
            block.nan += u64::from(value.is_nan() || value == f64::INFINITY);
            if accept(state.lp[w], value, own[w] - log_q, chance) {
                for k in 0..dim {
                    state.x[w * dim + k] = xs[k * count + i];
                }
                (state.lp[w], own[w]) = (value, log_q);
                block.accepted[w] += 1;
            }
            let step = i / WALKERS + 1;
            if w + 1 == WALKERS && step.is_multiple_of(span.thin.max(1)) {
                let column = |k: usize| state.x.iter().skip(k).step_by(dim).copied();
                block.x.extend((0..dim).flat_map(column));
                block.lp.extend_from_slice(&state.lp);
            }
        }
        state.step += span.steps as u64;
        state.drawn = rng.used();
        block.evaluations = count as u64;
        block.moves[0].proposed = count as u64;
        block.moves[0].accepted = block.accepted.iter().sum();
        Ok(())
    }
}
