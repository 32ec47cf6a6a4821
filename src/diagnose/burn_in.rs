//! Where chains join each other: what comes before is their way there.

use rayon::prelude::*;

use super::transform::sorted;
use crate::chain::Draws;
use crate::numeric::quantile;

/// Parts of a chain whose means are looked at.
const BLOCKS: usize = 20;

/// A block has joined where its mean is between these quantiles of the second halves of all chains.
const WITHIN: [f64; 2] = [0.005, 0.995];

/// The draw from which every chain is where all are in their second halves: 0 of one that began there, half of its draws at most.
pub fn joined(draws: &Draws) -> Vec<usize> {
    let length = draws.draws();
    let size = (length / BLOCKS).max(1);
    let ends = |p: usize| {
        let series = draws.series(p);
        let chains = 0..series.chains();
        let late = chains.flat_map(|c| series.chain(c)[length / 2..].iter().copied());
        let late = sorted(&late.collect::<Vec<f64>>());
        if late.is_empty() || late.iter().any(|v| !v.is_finite()) {
            return vec![0; series.chains()];
        }
        let [low, high] = WITHIN.map(|level| quantile(&late, level));
        let end = |c: usize| {
            let early = &series.chain(c)[..length / 2];
            let mean = |block: &[f64]| block.iter().sum::<f64>() / block.len() as f64;
            let apart = |block: &[f64]| !(low..=high).contains(&mean(block));
            early
                .chunks(size)
                .rposition(apart)
                .map_or(0, |k| ((k + 1) * size).min(length / 2))
        };
        (0..series.chains()).map(end).collect()
    };
    let none = || vec![0; draws.chains()];
    let later = |a: Vec<usize>, b: Vec<usize>| a.iter().zip(&b).map(|(a, b)| *a.max(b)).collect();
    (0..draws.dim())
        .into_par_iter()
        .map(ends)
        .reduce(none, later)
}
