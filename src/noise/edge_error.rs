//! The error of displacements where subsets end.
//!
//! Programs shift or cut the subsets that reach over an edge of the specimen, each in its own way: within one subset of a hole displacements
//! were off by a hundredth of a pixel along it and across, and effects that act at an edge were found that did not exist (a public test with
//! known constants). It is a smooth random field of each component, of variance s_e^2 h^2 where h = exp((1/2 - d) / decay) and d is the
//! distance of a point from the nearest edge, in subsets.

use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::reml::{Contrasts, Reml};
use super::{BlockCovariance, Hyperparameters, Matern};
use crate::error::Result;
use crate::field::Blocks;
use crate::field::near_edges::DECAYS;
use crate::files::stored;

/// The error near edges of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeError {
    /// Which of [`DECAYS`] it has.
    pub decay: usize,
    /// Correlation length along an edge, subsets.
    pub length_subsets: f64,
    /// Its variance half a subset from an edge over the white variance of a point.
    pub ratio: f64,
}

stored!(EdgeError {
    decay,
    length_subsets,
    ratio
});

/// Sizes and lengths that are tried (prototype study); the largest is that of a program that keeps no subset near edges right.
const RATIOS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
const LENGTHS: [f64; 2] = [1.0, 3.0];

/// Nats by which an error near edges must be likelier than none: two dozen of them are tried, which share one half of the probability.
const WORTH: f64 = 5.0;

/// Likeliest choices of the noise beside which it is looked for.
const NOISES: usize = 4;

impl EdgeError {
    /// All that are tried.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for decay in 0..DECAYS.len() {
            for length_subsets in LENGTHS {
                all.extend(RATIOS.map(|ratio| Self {
                    decay,
                    length_subsets,
                    ratio,
                }));
            }
        }
        all
    }

    /// The likeliest beside the noise of a component, by contrasts orthogonal to what explains it; none where edges are not known or none is
    /// likelier than noise alone by [`WORTH`].
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn find(blocks: &Blocks, contrasts: &Contrasts<'_>, alone: &Reml) -> Result<Option<Self>> {
        if blocks.near_edges.is_none() {
            return Ok(None);
        }
        let mut noise: Vec<&Hyperparameters> = alone.table.iter().collect();
        noise.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        noise.truncate(NOISES);
        let likelihood = |edge: &Self| -> Result<f64> {
            let beside = edge.beside(blocks);
            let mut best = f64::NEG_INFINITY;
            for at in &noise {
                let matern = Matern::new(blocks, at.length_mm);
                let covariance = BlockCovariance::new(&beside, &matern, at.ratio)?;
                best = best.max(contrasts.at(&covariance)?.log_likelihood);
            }
            Ok(best)
        };
        let all = Self::all();
        let found: Vec<Result<f64>> = all.par_iter().map(likelihood).collect();
        let found = found.into_iter().collect::<Result<Vec<f64>>>()?;
        let best = (0..all.len()).max_by(|&a, &b| found[a].total_cmp(&found[b]));
        let best = best.filter(|&k| found[k] > alone.best.log_likelihood + WORTH);
        Ok(best.map(|k| all[k]))
    }

    /// The same blocks, whose averages have this error beside their noise.
    #[must_use]
    pub fn beside(self, blocks: &Blocks) -> Blocks {
        let beside_noise = blocks.near_edges.as_ref().map(|near| {
            let weight = &near.weight[self.decay];
            let kernel = Matern::new(blocks, self.length_subsets * near.subset_mm).correlation;
            let size = self.ratio * blocks.mean_count();
            let entry = |i: usize, j: usize| size * weight[i] * weight[j] * kernel[(i, j)];
            Arc::new(DMatrix::from_fn(blocks.len(), blocks.len(), entry))
        });
        Blocks {
            beside_noise,
            ..blocks.clone()
        }
    }
}
