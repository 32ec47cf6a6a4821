//! Draws held in memory while a run goes: of a long run only every second, fourth, ... one.

use rayon::prelude::*;

use super::Block;
use crate::chain::Draws;
use crate::error::Result;

/// Draws of one ensemble in memory, at most a given number: beyond it every second one is let go, again and again.
pub(super) struct Memory {
    /// Draw x parameter x walker.
    x: Vec<f64>,
    /// Draw x walker.
    lp: Vec<f64>,
    walkers: usize,
    dim: usize,
    /// Most draws held of a chain.
    most: usize,
    stride: usize,
    /// Draws of each chain so far, held or not.
    seen: usize,
}

impl Memory {
    /// Of an ensemble of `walkers` in `dim` dimensions; at most `most` draws of each of its chains.
    pub(super) fn new(walkers: usize, dim: usize, most: usize) -> Self {
        Self {
            x: Vec::new(),
            lp: Vec::new(),
            walkers,
            dim,
            most,
            stride: 1,
            seen: 0,
        }
    }

    /// Draws from one held one to the next.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Draws of each chain so far, held or not.
    pub(super) fn seen(&self) -> usize {
        self.seen
    }

    /// Takes the draws of a block.
    pub(super) fn take(&mut self, block: &Block) {
        let (width, walkers) = (self.walkers * self.dim, self.walkers);
        let count = block.lp.len() / walkers;
        if self.stride == 1 && self.lp.len() / walkers + count <= self.most {
            self.x.extend_from_slice(&block.x);
            self.lp.extend_from_slice(&block.lp);
            self.seen += count;
            return;
        }
        for (x, lp) in block
            .x
            .chunks_exact(width)
            .zip(block.lp.chunks_exact(walkers))
        {
            self.push(x, lp);
        }
    }

    /// Takes one draw of all walkers: parameter x walker, and walker.
    pub(super) fn push(&mut self, x: &[f64], lp: &[f64]) {
        self.seen += 1;
        if !self.seen.is_multiple_of(self.stride) {
            return;
        }
        self.x.extend_from_slice(x);
        self.lp.extend_from_slice(lp);
        if self.lp.len() / self.walkers > self.most {
            self.halve();
        }
    }

    /// Keeps the draws that the doubled stride would have kept.
    fn halve(&mut self) {
        let width = self.walkers * self.dim;
        for (values, width) in [(&mut self.x, width), (&mut self.lp, self.walkers)] {
            let rows = values.len() / width / 2;
            for row in 0..rows {
                values.copy_within((2 * row + 1) * width..(2 * row + 2) * width, row * width);
            }
            values.truncate(rows * width);
        }
        self.stride *= 2;
    }

    /// Brings what is held to chain x draw x parameter, and chain x draw.
    fn transpose(&self, values: &mut [f64], lp: &mut [f64]) {
        /// Draws at a time, so that they stay in the cache while every chain takes its own.
        const TILE: usize = 16;
        let (walkers, dim) = (self.walkers, self.dim);
        let draws = self.lp.len() / walkers;
        for from in (0..draws).step_by(TILE) {
            let to = (from + TILE).min(draws);
            for walker in 0..walkers {
                let at = walker * draws;
                let points = values[(at + from) * dim..(at + to) * dim].chunks_exact_mut(dim);
                let rows = self.x[from * walkers * dim..].chunks_exact(walkers * dim);
                for (point, row) in points.zip(rows) {
                    for (value, column) in point.iter_mut().zip(row.chunks_exact(walkers)) {
                        *value = column[walker];
                    }
                }
                let rows = self.lp[from * walkers..].chunks_exact(walkers);
                for (value, row) in lp[at + from..at + to].iter_mut().zip(rows) {
                    *value = row[walker];
                }
            }
        }
    }
}

/// The draws held of all ensembles, chain by chain.
pub(super) fn draws(memories: &[Memory], names: &[String]) -> Result<Draws> {
    let total: usize = memories.iter().map(|m| m.lp.len()).sum();
    let (mut values, mut lp) = (vec![0.0; total * names.len()], vec![0.0; total]);
    if total > 0 {
        let share = total / memories.len();
        values
            .par_chunks_exact_mut(share * names.len())
            .zip(lp.par_chunks_exact_mut(share))
            .zip(memories)
            .for_each(|((values, lp), memory)| memory.transpose(values, lp));
    }
    let chains = |(ensemble, memory): (usize, &Memory)| vec![ensemble; memory.walkers];
    let ensemble = memories.iter().enumerate().flat_map(chains).collect();
    Draws::new(names.to_vec(), ensemble, values, lp)
}
