//! What was integrated out, drawn for every point of a chain: the noise, which effects act, and all amplitudes.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::density::{MixtureChoice, PosteriorDensity, lower};
use super::space::LinearRole;
use crate::numeric::relative_weights;
use crate::sample::Stream;

/// What is drawn beside a point.
#[derive(Debug, Clone)]
pub struct CompletedDraw {
    /// The noise, the candidates that act with their full prior sds, and the size of all others over theirs.
    pub choice: MixtureChoice,
    /// Amplitudes of the answer's linear columns, prior sds from their means.
    pub amplitudes: DVector<f64>,
}

/// Offers to every candidate, on average: of an unlikely one that does not act in the part where a draw begins, the first of five finds
/// 63 % of its probability, all five 99 %.
const SWEEPS: usize = 5;

/// What may act: the prior log probability of so many effects, and which candidates exclude each other.
pub struct Inclusion<'a> {
    /// Number of candidates; none where inclusion is not drawn.
    pub candidates: usize,
    pub log_prior: &'a (dyn Fn(usize) -> Option<f64> + Sync),
    pub excludes: &'a (dyn Fn(usize, usize) -> bool + Sync),
}

/// Draw what was integrated out at points of an answer, each with a stream of its own.
pub fn complete(
    density: &PosteriorDensity,
    points: &[Vec<f64>],
    inclusion: &Inclusion<'_>,
    stream: &(dyn Fn(usize) -> Stream + Sync),
) -> Vec<CompletedDraw> {
    let batches = points.par_chunks(BATCH);
    let weights: Vec<Vec<f64>> = batches.flat_map_iter(|x| density.weights(x)).collect();
    let at = |(k, (x, weights)): (usize, (&Vec<f64>, &Vec<f64>))| {
        drawn(density, (x, weights), inclusion, &mut stream(k))
    };
    let all = points.par_iter().zip(&weights).enumerate();
    all.map(at).collect()
}

/// Points whose weights are asked for at once: a single one costs as much as a vector of them.
const BATCH: usize = 500;

fn drawn(
    density: &PosteriorDensity,
    (x, weights): (&[f64], &[f64]),
    inclusion: &Inclusion<'_>,
    rng: &mut Stream,
) -> CompletedDraw {
    let (coordinates, factors) = density.place(x);
    let mut choice = choose(density, weights, rng);
    let (gram, right) = density.noise[choice.noise].at(&coordinates, &factors);
    let precision = density.noise_scale(x).powi(-2);
    let (gram, right) = (gram * precision, right * precision);
    let mut given = GivenChoice::new(density, (&gram, &right), &choice);
    for _ in 0..SWEEPS * inclusion.candidates {
        given = birth_or_death(given, (&gram, &right), &mut choice, inclusion, rng);
    }
    CompletedDraw {
        amplitudes: given.amplitudes(rng),
        choice,
    }
}

/// A part of the mixture by its weight.
fn choose(density: &PosteriorDensity, weights: &[f64], rng: &mut Stream) -> MixtureChoice {
    let shares = relative_weights(weights);
    let mut left = rng.uniform() * shares.iter().sum::<f64>();
    let place = shares.iter().position(|s| {
        left -= s;
        left < 0.0
    });
    density.choice(place.unwrap_or(0)).clone()
}

/// The linear amplitudes' normal distribution, given all else: gamma = K e, e of precision P = I + K' H K about P^-1 K' z.
pub struct GivenChoice<'a> {
    density: &'a PosteriorDensity,
    /// Prior sds of the columns over the largest ones.
    sds: DVector<f64>,
    /// K, with K K' the prior covariance of gamma.
    root: DMatrix<f64>,
    /// L of P = L L', and L^-1 K' z.
    factor: DMatrix<f64>,
    solved: DVector<f64>,
}

impl<'a> GivenChoice<'a> {
    /// Of a part of a density, at a point.
    pub fn at(density: &'a PosteriorDensity, x: &[f64], choice: &MixtureChoice) -> Self {
        let (coordinates, factors) = density.place(x);
        let (gram, right) = density.noise[choice.noise].at(&coordinates, &factors);
        let precision = density.noise_scale(x).powi(-2);
        Self::new(density, (&(gram * precision), &(right * precision)), choice)
    }

    pub fn new(
        density: &'a PosteriorDensity,
        at: (&DMatrix<f64>, &DVector<f64>),
        choice: &MixtureChoice,
    ) -> Self {
        let sds = density.space.sds(&choice.own, choice.size, choice.rival);
        let root = lower(&density.space.covariance(&sds));
        let n = root.nrows();
        let mut factor = root.tr_mul(at.0) * &root;
        for k in 0..n {
            factor[(k, k)] += 1.0;
        }
        let factor = lower(&factor);
        let solved = root.tr_mul(at.1);
        let solved = factor.solve_lower_triangular(&solved).unwrap_or(solved);
        Self {
            density,
            sds,
            root,
            factor,
            solved,
        }
    }

    /// z' P^-1 z: what the amplitudes explain of the data.
    pub fn explained(&self) -> f64 {
        self.solved.norm_squared()
    }

    /// z' P^-1 w of another right side w.
    pub fn along(&self, other: &DVector<f64>) -> f64 {
        let turned = self.root.tr_mul(other);
        let half = self.factor.solve_lower_triangular(&turned);
        half.map_or(0.0, |half| half.dot(&self.solved))
    }

    /// A draw of gamma.
    fn gamma(&self, rng: &mut Stream) -> DVector<f64> {
        let y = self.solved.map(|y| y + rng.normal());
        &self.root * self.back(&y)
    }

    /// L'^-1 y.
    fn back(&self, y: &DVector<f64>) -> DVector<f64> {
        let solved = self.factor.transpose().solve_upper_triangular(y);
        solved.unwrap_or_else(|| y.clone())
    }

    /// Amplitudes of all columns, in their prior sds: what the data see of them, and the rest by the prior.
    pub fn amplitudes(&self, rng: &mut Stream) -> DVector<f64> {
        let prior = self.sds.map(|sd| sd * rng.normal());
        let gamma = self.gamma(rng);
        let space = &self.density.space;
        let missing = gamma - space.seen.tr_mul(&prior);
        self.towards(&missing, &prior).component_mul(&space.largest)
    }

    /// prior + S^2 V (V' S^2 V)^-1 missing.
    fn towards(&self, missing: &DVector<f64>, prior: &DVector<f64>) -> DVector<f64> {
        let n = self.root.nrows();
        let solved = self.root.solve_lower_triangular(missing);
        let solved = solved.and_then(|y| self.root.transpose().solve_upper_triangular(&y));
        let solved = solved.unwrap_or_else(|| DVector::zeros(n));
        let back = &self.density.space.seen * solved;
        prior + back.component_mul(&self.sds).component_mul(&self.sds)
    }

    /// Mean and covariance of the amplitudes of some columns, over their largest prior sds.
    pub fn moments(&self, columns: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.root.nrows();
        // rows of S^2 V K'^-1: what a column's amplitude has of e
        let seen = &self.density.space.seen;
        let rows = DMatrix::from_fn(n, columns.len(), |i, j| {
            seen[(columns[j], i)] * self.sds[columns[j]].powi(2)
        });
        let of = self
            .root
            .solve_lower_triangular(&rows)
            .unwrap_or_else(|| DMatrix::zeros(n, columns.len()));
        let e = self.back(&self.solved);
        let half = self
            .factor
            .solve_lower_triangular(&of)
            .unwrap_or_else(|| DMatrix::zeros(n, columns.len()));
        let mut covariance = half.tr_mul(&half) - of.tr_mul(&of);
        for (k, &column) in columns.iter().enumerate() {
            covariance[(k, k)] += self.sds[column].powi(2);
        }
        (of.tr_mul(&e), covariance)
    }
}

/// Offer a candidate drawn at random to enter the account with its full prior sds, or to leave it, where G and z are `at`, and take the offer by the ratio of
/// the posterior probabilities, all amplitudes integrated out (a Metropolis step on the set of acting effects).
pub fn birth_or_death<'a>(
    given: GivenChoice<'a>,
    at: (&DMatrix<f64>, &DVector<f64>),
    choice: &mut MixtureChoice,
    inclusion: &Inclusion<'_>,
    rng: &mut Stream,
) -> GivenChoice<'a> {
    let candidate =
        ((rng.uniform() * inclusion.candidates as f64) as usize).min(inclusion.candidates - 1);
    let chance = rng.uniform();
    let inside = choice.own.contains(&candidate);
    let count = choice.own.len();
    let to = if inside { count - 1 } else { count + 1 };
    let excluded = !inside
        && choice
            .own
            .iter()
            .any(|&k| (inclusion.excludes)(k, candidate));
    let (Some(before), Some(after)) = ((inclusion.log_prior)(count), (inclusion.log_prior)(to))
    else {
        return given;
    };
    if excluded {
        return given;
    }
    let sd = if inside { choice.size } else { 1.0 };
    let ratio = after - before + given.log_ratio(candidate, sd);
    if chance.ln() >= ratio {
        return given;
    }
    if inside {
        choice.own.retain(|k| *k != candidate);
    } else {
        choice.own.push(candidate);
        choice.own.sort_unstable();
    }
    GivenChoice::new(given.density, at, choice)
}

impl GivenChoice<'_> {
    /// Log ratio of the evidence if a candidate's amplitudes had another prior sd (over the prior's own): the mean, over the amplitudes
    /// as they are now, of the ratio of the two priors.
    pub fn log_ratio(&self, candidate: usize, sd: f64) -> f64 {
        let space = &self.density.space;
        let columns: Vec<usize> = (0..space.whose.len())
            .filter(|&k| space.whose[k] == LinearRole::Candidate(candidate))
            .collect();
        if columns.is_empty() {
            return 0.0;
        }
        let (mean, covariance) = self.moments(&columns);
        let old: Vec<f64> = columns.iter().map(|&k| self.sds[k]).collect();
        let new: Vec<f64> = columns.iter().map(|&k| sd / space.largest[k]).collect();
        // N(m, C) times exp(-a' D a / 2), D the difference of the priors' precisions
        let n = columns.len();
        let difference = DVector::from_fn(n, |k, _| new[k].powi(-2) - old[k].powi(-2));
        let m = DMatrix::identity(n, n)
            + DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * difference[j]);
        let lu = m.lu();
        let det = lu.determinant();
        let Some(pulled) = lu.solve(&mean).filter(|_| det > 0.0) else {
            return f64::NEG_INFINITY;
        };
        let quadratic: f64 = (0..n).map(|k| mean[k] * difference[k] * pulled[k]).sum();
        let normal: f64 = (0..n).map(|k| (old[k] / new[k]).ln()).sum();
        normal - 0.5 * quadratic - 0.5 * det.ln()
    }
}
