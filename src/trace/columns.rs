//! Columns that were not weighed, under noise that was.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::sensitivities::Measured;
use super::weighing::{NoiseChoice, NoisePair, Source, Weighing};
use crate::error::Result;
use crate::noise::series::{Frames, grams as series_grams};
use crate::noise::{BlockCovariance, Matern};

impl Weighing {
    /// X' C^-1 X of columns (of u1 and of u2, one row a value) under some pairs.
    ///
    /// # Errors
    /// Of the program: a factorisation that fails.
    pub fn grams(
        &self,
        measured: &Measured,
        columns: [&DMatrix<f64>; 2],
        pairs: &[NoisePair],
    ) -> Result<Vec<DMatrix<f64>>> {
        let choices = match &self.source {
            Source::Components(choices) => choices,
            Source::Series(noise) => {
                let frames = Frames {
                    blocks: &measured.blocks,
                    loads: noise.in_frames.loads.clone(),
                    // only the search for the noise asks for it
                    subset_mm: None,
                };
                let which: Vec<usize> = pairs.iter().map(|p| p.of[0]).collect();
                return series_grams(&frames, noise, columns, &which);
            }
        };
        let mut wanted: Vec<(usize, usize)> = pairs
            .iter()
            .flat_map(|p| [(0, p.of[0]), (1, p.of[1])])
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        let found: Vec<Result<DMatrix<f64>>> = wanted
            .par_iter()
            .map(|&(c, k)| {
                let NoiseChoice { at, scale2, .. } = &choices[c][k];
                let matern = Matern::new(&measured.blocks, at.length_mm);
                let covariance = BlockCovariance::new(&measured.blocks, &matern, at.ratio)?;
                let white = covariance.whiten(columns[c]);
                Ok(white.tr_mul(&white) / *scale2)
            })
            .collect();
        let found = found.into_iter().collect::<Result<Vec<_>>>()?;
        let of = |c: usize, k: usize| {
            let at = wanted.iter().position(|w| *w == (c, k));
            &found[at.unwrap_or(0)]
        };
        Ok(pairs
            .iter()
            .map(|p| of(0, p.of[0]) + of(1, p.of[1]))
            .collect())
    }

    /// Log prior of a pair with the normalisation of its noise: the log density of data that columns explain entirely.
    pub fn log_norm(&self, pair: &NoisePair) -> f64 {
        let log_det = match &self.source {
            Source::Components([first, second]) => {
                first[pair.of[0]].log_det + second[pair.of[1]].log_det
            }
            Source::Series(noise) => noise.settings[pair.of[0]].log_det,
        };
        pair.log_prior - 0.5 * log_det
    }
}
