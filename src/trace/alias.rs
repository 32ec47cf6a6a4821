//! Which effects this measurement cannot tell apart.

use nalgebra::DMatrix;

use super::subsets::{Subset, SubsetPosterior};
use crate::noise::NormalEquations;
use crate::posterior::Projected;

/// A swap that costs a log Bayes factor below this cannot be excluded. Groups by the cosine of signatures came out too wide for loud
/// effects and too narrow for quiet ones: even a cosine of 1.000 separates where the effect is large enough to be nonlinear (prototype
/// study).
pub const SWAP: f64 = 5.0;

/// The effects, or pairs of effects, that could stand in for one of the best subset.
#[derive(Debug, Clone)]
pub struct AliasGroup {
    /// The member of the best subset.
    pub leader: usize,
    /// All single members, the leader among them, the likeliest first.
    pub members: Vec<usize>,
    /// Pairs that together could stand in, beyond the single members.
    pub pairs: Vec<[usize; 2]>,
    /// Probability that some member, or a whole pair, acts.
    pub probability: f64,
    /// Log Bayes factor for the leader against its being dropped without a substitute.
    pub log_bayes_factor: f64,
}

/// The groups of the best subset, the costliest to drop first.
pub fn groups(subsets: &SubsetPosterior) -> Vec<AliasGroup> {
    let best = subsets.best().clone();
    let reference = subsets.log_evidence(&best);
    let mut groups: Vec<AliasGroup> = best
        .iter()
        .map(|&leader| group(subsets, &best, leader, reference))
        .collect();
    groups.sort_by(|a, b| b.log_bayes_factor.total_cmp(&a.log_bayes_factor));
    groups
}

fn group(subsets: &SubsetPosterior, best: &Subset, leader: usize, reference: f64) -> AliasGroup {
    let without: Subset = best.iter().copied().filter(|&k| k != leader).collect();
    let with = |more: &[usize]| {
        let mut s: Subset = without.iter().chain(more).copied().collect();
        s.sort_unstable();
        s
    };
    let log_bayes_factor = reference - subsets.log_evidence(&without);
    let free: Vec<usize> = (0..subsets.layout.ranges.len())
        .filter(|k| !best.contains(k))
        .collect();
    let mut members: Vec<(f64, usize)> = vec![(reference, leader)];
    for &k in &free {
        let evidence = subsets.log_evidence(&with(&[k]));
        // a swap that is no better than leaving the effect out replaces nothing
        if reference - evidence < SWAP.min(log_bayes_factor) {
            members.push((evidence, k));
        }
    }
    members.sort_by(|a, b| b.0.total_cmp(&a.0));
    let members: Vec<usize> = members.into_iter().map(|(_, k)| k).collect();
    let mut pairs = Vec::new();
    if log_bayes_factor > SWAP {
        for (i, &a) in free.iter().enumerate() {
            for &b in &free[i + 1..] {
                if members.contains(&a) || members.contains(&b) {
                    continue;
                }
                if reference - subsets.log_evidence(&with(&[a, b])) < SWAP {
                    pairs.push([a, b]);
                }
            }
        }
    }
    let probability = subsets.probability(|s| {
        members.iter().any(|k| s.contains(k))
            || pairs.iter().any(|[a, b]| s.contains(a) && s.contains(b))
    });
    AliasGroup {
        leader,
        members,
        pairs,
        probability,
        log_bayes_factor,
    }
}

/// An effect outside a group whose signature comes close to the leader's: finer shape or plausible size speak against it.
#[derive(Debug, Clone)]
pub struct Lookalike {
    pub candidate: usize,
    /// Cosine of the angle between the leader's part of the field and the nearest field of this effect, both with
    /// everything absorbable projected out.
    pub cosine: f64,
    /// Amplitudes of that nearest field, prior sds.
    pub amplitude: Vec<f64>,
    /// Log Bayes factor for the leader against it in the leader's place.
    pub log_bayes_factor_lost: f64,
}

/// What resembles a group's leader as it acts in the best subset, members of the group or not, the most similar first.
pub fn lookalikes(subsets: &SubsetPosterior, group: &AliasGroup) -> Vec<Lookalike> {
    let best = subsets.best();
    let (mean, _) = subsets.amplitudes(best);
    let before = best.iter().take_while(|k| **k != group.leader);
    let at: usize = before.map(|&k| subsets.layout.ranges[k].len()).sum();
    let own = &subsets.layout.ranges[group.leader];
    let a = mean.rows(at, own.len());
    let g = &subsets.projected[subsets.best_pair].g;
    let norm2 = a.dot(&(block(g, own, own) * a));
    let reference = subsets.log_evidence(best);
    let one = |candidate: usize| -> Option<Lookalike> {
        let other = &subsets.layout.ranges[candidate];
        let towards = block(g, other, own) * a;
        // with its prior, so that what cannot be seen stays where it is
        let precision = block(g, other, other);
        let nearest = NormalEquations::with_unit_prior(precision, towards.clone())?.mean();
        let cosine = (towards.dot(&nearest) / norm2).max(0.0).sqrt().min(1.0);
        let mut swapped: Subset = best
            .iter()
            .copied()
            .filter(|&k| k != group.leader)
            .chain([candidate])
            .collect();
        swapped.sort_unstable();
        Some(Lookalike {
            candidate,
            cosine,
            amplitude: nearest.as_slice().to_vec(),
            log_bayes_factor_lost: reference - subsets.log_evidence(&swapped),
        })
    };
    // another law of an effect is no other effect
    let others = (0..subsets.layout.ranges.len()).filter(|&k| {
        !best.contains(&k)
            && !subsets.layout.ranges[k].is_empty()
            && !subsets.layout.same(k, group.leader)
    });
    let mut found: Vec<Lookalike> = others
        .filter_map(one)
        .filter(|l| l.cosine > SIMILAR)
        .collect();
    found.sort_by(|a, b| b.cosine.total_cmp(&a.cosine));
    // of an effect's laws the nearest
    let mut nearest: Vec<Lookalike> = Vec::new();
    for l in found {
        let same = |n: &Lookalike| subsets.layout.same(n.candidate, l.candidate);
        if !nearest.iter().any(same) {
            nearest.push(l);
        }
    }
    nearest
}

/// Cosine above which signatures are called similar. They are reported beside the alias groups, which rest on the evidence.
pub const SIMILAR: f64 = 0.9;

/// Some rows and columns of a matrix.
fn block(g: &DMatrix<f64>, rows: &[usize], cols: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), cols.len(), |i, j| g[(rows[i], cols[j])])
}

/// Cosine of the angle between two effects' signatures with everything absorbable projected out: the largest canonical
/// correlation of their columns under one pair of hyperparameters.
pub fn cosine(projected: &Projected, a: &[usize], b: &[usize]) -> f64 {
    let g = &projected.g;
    let root = |columns: &[usize]| {
        let eigen = block(g, columns, columns).symmetric_eigen();
        let floor = 1e-9 * eigen.eigenvalues.amax();
        let scale = eigen
            .eigenvalues
            .map(|e| if e > floor { 1.0 / e.sqrt() } else { 0.0 });
        &eigen.eigenvectors * DMatrix::from_diagonal(&scale) * eigen.eigenvectors.transpose()
    };
    let correlation = root(a) * block(g, a, b) * root(b);
    correlation.singular_values().max().min(1.0)
}
