//! Which columns belong to which candidate, and the evidence of a subset of them.

use nalgebra::{DMatrix, DVector};

use super::wedge::{log_in_wedge, log_positive};
use crate::linearise::Candidate;
use crate::linearise::lift_of;
use crate::noise::NormalEquations;
use crate::posterior::Projected;

/// A subset of the candidates, in increasing order.
pub type Subset = Vec<usize>;

/// Which columns are whose, and what their amplitudes cannot be.
pub struct CandidateLayout {
    /// Columns of each candidate among the candidates' columns.
    pub ranges: Vec<Vec<usize>>,
    /// Whether a column's amplitude cannot be negative: its prior is half a normal one.
    positive: Vec<bool>,
    /// Weights of each candidate's first two columns whose sum cannot be negative, nor can the first.
    wedges: Vec<Option<[f64; 2]>>,
    /// Names of the candidates' effects: no subset holds one twice, by two laws.
    names: Vec<&'static str>,
    /// Pairs that are one motion: a rotation, and the lift by its law of an axis off the hole.
    one_motion: Vec<[usize; 2]>,
}

/// Two parts of a field whose cosine is below minus this are one effect taken twice with opposite signs: a hole size and an edge
/// damage of opposite signs were accepted together (measured on the program as built).
const OPPOSITE: f64 = 0.95;

impl CandidateLayout {
    /// Of candidates in order.
    pub fn new(candidates: &[Candidate]) -> Self {
        let mut next = 0;
        let ranges = candidates.iter().map(|c| {
            next += c.columns.len();
            (next - c.columns.len()..next).collect()
        });
        let columns = candidates.iter().flat_map(|c| &c.columns);
        Self {
            ranges: ranges.collect(),
            positive: columns.map(|c| c.positive).collect(),
            wedges: candidates.iter().map(wedge).collect(),
            names: candidates.iter().map(|c| c.effect.name()).collect(),
            one_motion: one_motion(candidates),
        }
    }

    /// Columns of a subset among the candidates' columns.
    pub fn columns(&self, subset: &Subset) -> Vec<usize> {
        columns(&self.ranges, subset)
    }

    /// Log Bayes factor of a subset against no effect: that of normal priors, times the share of the posterior where
    /// amplitudes that cannot be negative are not; none for effects that undo each other.
    pub fn log_bayes_factor(&self, projected: &Projected, subset: &Subset) -> f64 {
        if subset.is_empty() {
            return 0.0;
        }
        if self.repeats(subset) {
            return f64::NEG_INFINITY;
        }
        let columns = self.columns(subset);
        let Some(fit) = restrict(projected, &columns) else {
            return f64::NEG_INFINITY;
        };
        let mut log = fit.log_evidence();
        let signed = columns.iter().any(|&k| self.positive[k]);
        if !signed && subset.len() < 2 {
            return log;
        }
        let mean = fit.mean();
        if signed {
            log += self.log_possible(subset, &mean, &fit.covariance());
        }
        if self.opposed(projected, subset, &mean) {
            return f64::NEG_INFINITY;
        }
        log
    }

    /// Log of the share of the posterior of a subset's amplitudes where none has a sign that it cannot have, over that of the prior.
    fn log_possible(&self, subset: &Subset, mean: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let (mut log, mut at) = (0.0, 0);
        for &k in subset {
            if let Some(weights) = self.wedges[k] {
                let own = covariance.fixed_view::<2, 2>(at, at).into_owned();
                log += log_in_wedge(mean.fixed_rows::<2>(at).into_owned(), &own, weights);
            } else {
                let columns = self.ranges[k].iter().zip(at..);
                let positive = columns.filter(|(column, _)| self.positive[**column]);
                log += positive
                    .map(|(_, i)| log_positive(mean[i] / covariance[(i, i)].sqrt()))
                    .sum::<f64>();
            }
            at += self.ranges[k].len();
        }
        log
    }

    /// Whether two candidates are one effect by two laws.
    pub fn same(&self, a: usize, b: usize) -> bool {
        self.names[a] == self.names[b]
    }

    /// Whether a subset holds an effect or a motion twice.
    fn repeats(&self, subset: &Subset) -> bool {
        let whole = |pair: &[usize; 2]| pair.iter().all(|k| subset.contains(k));
        if self.one_motion.iter().any(whole) {
            return true;
        }
        let names = subset.iter().map(|&k| self.names[k]);
        names
            .enumerate()
            .any(|(i, name)| subset[..i].iter().any(|&k| self.names[k] == name))
    }

    /// Whether two effects of a subset undo each other at amplitudes `mean`, what the base model absorbs left aside.
    fn opposed(&self, projected: &Projected, subset: &Subset, mean: &DVector<f64>) -> bool {
        let mut at = 0;
        let parts: Vec<(&Vec<usize>, usize)> = subset
            .iter()
            .map(|&k| {
                at += self.ranges[k].len();
                (&self.ranges[k], at - self.ranges[k].len())
            })
            .collect();
        let product = |a: &(&Vec<usize>, usize), b: &(&Vec<usize>, usize)| {
            let mut sum = 0.0;
            for (i, &p) in a.0.iter().enumerate() {
                for (j, &q) in b.0.iter().enumerate() {
                    sum += mean[a.1 + i] * projected.g[(p, q)] * mean[b.1 + j];
                }
            }
            sum
        };
        parts.iter().enumerate().any(|(k, a)| {
            parts[..k].iter().any(|b| {
                let ab = product(a, b);
                ab < 0.0 && ab * ab > OPPOSITE * OPPOSITE * product(a, a) * product(b, b)
            })
        })
    }
}

/// Weights of amplitudes in prior sds whose sum cannot be negative.
fn wedge(candidate: &Candidate) -> Option<[f64; 2]> {
    let weights = candidate.effect.never_negative()?;
    Some([0, 1].map(|k| weights[k] * candidate.columns[k].sd))
}

/// Pairs of a rotation and the lift of its axis by the same law, as indices of candidates.
fn one_motion(candidates: &[Candidate]) -> Vec<[usize; 2]> {
    let mut pairs = Vec::new();
    for (i, rotation) in candidates.iter().enumerate() {
        let Some(lift) = lift_of(rotation.effect) else {
            continue;
        };
        let lifts = |c: &Candidate| c.effect.name() == lift && c.law == rotation.law;
        let own = candidates.iter().enumerate().filter(|(_, c)| lifts(c));
        pairs.extend(own.map(|(j, _)| [i, j]));
    }
    pairs
}

/// Columns of a subset among the candidates' columns.
pub fn columns(ranges: &[Vec<usize>], subset: &Subset) -> Vec<usize> {
    subset
        .iter()
        .flat_map(|&k| ranges[k].iter().copied())
        .collect()
}

/// (I + G) a = z of some columns; none where rounding leaves dependent columns without a factor.
pub fn restrict(projected: &Projected, columns: &[usize]) -> Option<NormalEquations> {
    let unscaled: Vec<(usize, f64)> = columns.iter().map(|&k| (k, 1.0)).collect();
    NormalEquations::of_columns(&projected.g, |k| projected.z[k], &unscaled)
}
