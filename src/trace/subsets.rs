//! Which effects act: the closed-form evidence of every subset of up to four candidates, averaged over the noise.
//!
//! With the base columns eliminated and every amplitude in units of its prior sd,
//! log BF_S = z_S' (I + G_S)^-1 z_S / 2 - log |I + G_S| / 2 against no effect.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

pub use super::layout::Subset;
use super::layout::{CandidateLayout, restrict};
use crate::error::Result;
use crate::linearise::Candidate;
use crate::numeric::log_sum_exp;
use crate::posterior::{Projected, Weighing};

/// Prior probabilities of 0, 1, .. effects, shared equally by the subsets of each size. In the prototype study they named 51 of 51
/// single effects, 12 of 12 pairs and 12 of 16 triples exactly. All subsets up to four are enumerated (5,036 of 19 effects): greedy growth
/// with swaps found the same best one in 58 of 60 fields.
pub const SIZES: [f64; 5] = [0.5, 0.3, 0.12, 0.05, 0.03];

/// Subsets of each enumeration that are weighed under every pair of hyperparameters.
const WEIGHED: usize = 40;

/// Pairs of a subset and the noise that count hold this much of the probability of all.
const MOST_OF_IT: f64 = 0.99;

/// A weighed subset.
#[derive(Debug, Clone)]
pub struct WeighedSubset {
    /// The candidates in it.
    pub subset: Subset,
    /// Posterior probability among all weighed subsets.
    pub probability: f64,
    /// Log posterior weight: evidence and prior.
    pub log_weight: f64,
}

/// The posterior over subsets and hyperparameters.
pub struct SubsetPosterior {
    /// Weighed subsets, the most probable first.
    pub ranked: Vec<WeighedSubset>,
    /// Probability of a smooth discrepancy.
    pub discrepancy: f64,
    /// The most probable pair of hyperparameters.
    pub best_pair: usize,
    /// The candidates' columns.
    pub layout: CandidateLayout,
    /// Candidates' normal equations under every pair.
    pub projected: Vec<Projected>,
    /// Prior log probability of a subset by its size.
    log_prior: Vec<f64>,
}

impl SubsetPosterior {
    /// Enumerate.
    ///
    /// # Errors
    /// Of the program, for columns that are not finite.
    pub fn new(weighing: &Weighing, candidates: &[Candidate]) -> Result<Self> {
        let layout = CandidateLayout::new(candidates);
        let projected: Vec<Projected> = weighing
            .pairs
            .par_iter()
            .map(|pair| weighing.project(pair))
            .collect::<Result<_>>()?;
        let log_prior = log_priors(candidates.len());
        let all = subsets(candidates.len());
        let mut chosen: BTreeSet<Subset> = BTreeSet::new();
        for pair in leading_pairs(weighing, &projected, &layout, &all, &log_prior) {
            let mut scored: Vec<(f64, &Subset)> = all
                .par_iter()
                .map(|s| {
                    let score = layout.log_bayes_factor(&projected[pair], s);
                    (score + log_prior[s.len()], s)
                })
                .collect();
            scored.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(b.1)));
            chosen.extend(scored.iter().take(WEIGHED).map(|(_, s)| (*s).clone()));
            chosen.extend(all.iter().filter(|s| s.len() <= 1).cloned());
        }
        let chosen: Vec<Subset> = chosen.into_iter().collect();
        let mut subsets = Self {
            ranked: Vec::new(),
            discrepancy: 0.0,
            best_pair: 0,
            layout,
            projected,
            log_prior,
        };
        subsets.weigh(weighing, chosen);
        Ok(subsets)
    }

    fn weigh(&mut self, weighing: &Weighing, chosen: Vec<Subset>) {
        let by_pair: Vec<Vec<f64>> = chosen
            .par_iter()
            .map(|s| self.evidence_by_pair(s))
            .collect();
        let log_weight: Vec<f64> = chosen
            .iter()
            .zip(&by_pair)
            .map(|(s, e)| log_sum_exp(e.iter().copied()) + self.log_prior[s.len()])
            .collect();
        let total = log_sum_exp(log_weight.iter().copied());
        let mut pair_weight = vec![f64::NEG_INFINITY; weighing.pairs.len()];
        for (s, evidence) in chosen.iter().zip(&by_pair) {
            for (w, e) in pair_weight.iter_mut().zip(evidence) {
                *w = log_add(*w, e + self.log_prior[s.len()]);
            }
        }
        self.best_pair = (0..pair_weight.len())
            .max_by(|&a, &b| pair_weight[a].total_cmp(&pair_weight[b]))
            .unwrap_or(0);
        self.discrepancy = weighing
            .pairs
            .iter()
            .zip(&pair_weight)
            .filter(|(pair, _)| pair.discrepancy)
            .map(|(_, w)| (w - total).exp())
            .sum();
        self.ranked = chosen
            .into_iter()
            .zip(log_weight)
            .map(|(subset, log_weight)| WeighedSubset {
                probability: (log_weight - total).exp(),
                log_weight,
                subset,
            })
            .collect();
        self.ranked.sort_by(|a, b| {
            b.log_weight
                .total_cmp(&a.log_weight)
                .then_with(|| a.subset.cmp(&b.subset))
        });
    }

    fn evidence_by_pair(&self, subset: &Subset) -> Vec<f64> {
        self.projected
            .iter()
            .map(|p| p.log_base + self.layout.log_bayes_factor(p, subset))
            .collect()
    }

    /// The likeliest subsets, each with a choice of the noise: at most `count`, with the prior log probability of the subset.
    pub fn likeliest(&self, count: usize) -> Vec<(&Subset, usize, f64)> {
        let mut all: Vec<(f64, &Subset, usize)> = Vec::new();
        for weighed in self.ranked.iter().take(count) {
            let log_prior = self.log_prior[weighed.subset.len()];
            let evidence = self.evidence_by_pair(&weighed.subset).into_iter();
            let pairs = evidence.enumerate();
            all.extend(pairs.map(|(k, e)| (e + log_prior, &weighed.subset, k)));
        }
        all.sort_by(|a, b| {
            b.0.total_cmp(&a.0)
                .then_with(|| (a.1, a.2).cmp(&(b.1, b.2)))
        });
        let total = log_sum_exp(all.iter().map(|a| a.0));
        let mut held = 0.0;
        let kept = all.into_iter().take(count).take_while(|a| {
            let wanted = held < MOST_OF_IT;
            held += (a.0 - total).exp();
            wanted
        });
        kept.map(|(_, s, k)| (s, k, self.log_prior[s.len()]))
            .collect()
    }

    /// Log evidence of any subset, averaged over the noise.
    pub fn log_evidence(&self, subset: &Subset) -> f64 {
        log_sum_exp(self.evidence_by_pair(subset).into_iter())
    }

    /// Log prior probability of a subset of so many effects.
    pub fn log_prior(&self, size: usize) -> f64 {
        self.log_prior[size]
    }

    /// The most probable subset.
    pub fn best(&self) -> &Subset {
        &self.ranked[0].subset
    }

    /// Probability that a property holds of the subset.
    pub fn probability(&self, holds: impl Fn(&Subset) -> bool) -> f64 {
        self.ranked
            .iter()
            .filter(|w| holds(&w.subset))
            .map(|w| w.probability)
            .sum::<f64>()
            .min(1.0)
    }

    /// Log Bayes factor for a candidate: posterior odds over prior odds of its being in the subset.
    pub fn log_bayes_factor_of(&self, candidate: usize) -> f64 {
        // where few of the weighed subsets hold the candidate (or lack it), the best subset with it taken in (or out) is most of that
        // side's probability, and must be counted even if it was not among them
        let mut other = self.best().clone();
        if other.contains(&candidate) {
            other.retain(|k| *k != candidate);
        } else {
            other.push(candidate);
            other.sort_unstable();
        }
        let weighed = self.ranked.iter().any(|w| w.subset == other);
        let extra = match self.log_prior.get(other.len()) {
            Some(prior) if !weighed => self.log_evidence(&other) + prior,
            _ => f64::NEG_INFINITY,
        };
        let side = |inside: bool| {
            let weights = self
                .ranked
                .iter()
                .filter(move |w| w.subset.contains(&candidate) == inside);
            let known = log_sum_exp(weights.map(|w| w.log_weight));
            if other.contains(&candidate) == inside {
                log_add(known, extra)
            } else {
                known
            }
        };
        let candidates = self.layout.ranges.len() as f64;
        let mean_size: f64 = SIZES.iter().enumerate().map(|(n, p)| n as f64 * p).sum();
        let prior = (mean_size / candidates).clamp(1e-6, 1.0 - 1e-6);
        side(true) - side(false) - (prior / (1.0 - prior)).ln()
    }

    /// Mean and covariance of the amplitudes of a subset's columns, prior sds, under the most probable noise.
    pub fn amplitudes(&self, subset: &Subset) -> (DVector<f64>, DMatrix<f64>) {
        let columns = self.layout.columns(subset);
        restrict(&self.projected[self.best_pair], &columns).map_or_else(
            || {
                let n = columns.len();
                (DVector::zeros(n), DMatrix::identity(n, n))
            },
            |f| (f.mean(), f.covariance()),
        )
    }

    /// Drop in chi^2 of the data, under the most probable noise, when a subset acts at its best amplitudes.
    pub fn explained(&self, subset: &Subset) -> f64 {
        let columns = self.layout.columns(subset);
        let Some(fit) = restrict(&self.projected[self.best_pair], &columns) else {
            return 0.0;
        };
        // 2 z'a - a'G a = z'a + a'a at the mean a, where (I + G) a = z
        fit.quadratic() + fit.mean().norm_squared()
    }
}

/// The likeliest pair of hyperparameters without and with a discrepancy, each for the best subset it would have.
fn leading_pairs(
    weighing: &Weighing,
    projected: &[Projected],
    layout: &CandidateLayout,
    all: &[Subset],
    log_prior: &[f64],
) -> Vec<usize> {
    let greedy: Vec<f64> = projected
        .par_iter()
        .map(|p| p.log_base + best_of_growing(p, layout, log_prior))
        .collect();
    debug_assert!(!all.is_empty());
    [false, true]
        .into_iter()
        .filter_map(|discrepancy| {
            (0..weighing.pairs.len())
                .filter(|&k| weighing.pairs[k].discrepancy == discrepancy)
                .max_by(|&a, &b| greedy[a].total_cmp(&greedy[b]))
        })
        .collect()
}

/// Score of the best subset found by adding one candidate at a time.
fn best_of_growing(p: &Projected, layout: &CandidateLayout, log_prior: &[f64]) -> f64 {
    let mut subset: Subset = Vec::new();
    let mut best = log_prior[0];
    while subset.len() + 1 < log_prior.len() {
        let grown = (0..layout.ranges.len())
            .filter(|k| !subset.contains(k))
            .map(|k| {
                let mut s = subset.clone();
                s.push(k);
                (layout.log_bayes_factor(p, &s), s)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((score, grown)) = grown else { break };
        best = best.max(score + log_prior[grown.len()]);
        subset = grown;
    }
    best
}

/// All subsets of up to four of `n` candidates, smallest first.
fn subsets(n: usize) -> Vec<Subset> {
    let mut all: Vec<Subset> = vec![Vec::new()];
    let mut from = 0;
    for _ in 1..SIZES.len() {
        let to = all.len();
        for s in from..to {
            let first = all[s].last().map_or(0, |k| k + 1);
            for k in first..n {
                let mut grown = all[s].clone();
                grown.push(k);
                all.push(grown);
            }
        }
        from = to;
    }
    all
}

/// Log prior probability of a subset by size, for `n` candidates.
fn log_priors(n: usize) -> Vec<f64> {
    let mut choices = 1.0;
    SIZES
        .iter()
        .enumerate()
        .take(n + 1)
        .map(|(size, p): (usize, &f64)| {
            if size > 0 {
                choices *= (n + 1 - size) as f64 / size as f64;
            }
            (p / choices).ln()
        })
        .collect()
}

fn log_add(a: f64, b: f64) -> f64 {
    log_sum_exp([a, b].into_iter())
}
