//! Draws held in memory while a run goes: of a long run only every second, fourth, ... one.

use rayon::prelude::*;

use super::Block;
use crate::chain::Draws;
use crate::error::Result;

/// Draws of one ensemble in memory, at most a given number: beyond it every second one is let go, again and again.
pub(super) struct Memory {
    pieces: Vec<Piece>,
    walkers: usize,
    dim: usize,
    /// Most draws held of a chain.
    most: usize,
    /// Draws held of a chain.
    held: usize,
    stride: usize,
    /// Draws of each chain so far, held or not.
    seen: usize,
}

/// Draws that follow one another, as a block has them: held as they came, because touching fresh memory once more costs
/// as much as the draws themselves.
#[derive(Default)]
struct Piece {
    /// Draw x parameter x walker.
    x: Vec<f64>,
    /// Draw x walker.
    lp: Vec<f64>,
}

impl Piece {
    /// Draw by draw.
    fn rows(&self, walkers: usize, dim: usize) -> impl Iterator<Item = (&[f64], &[f64])> {
        self.x
            .chunks_exact(walkers * dim)
            .zip(self.lp.chunks_exact(walkers))
    }

    fn push(&mut self, x: &[f64], lp: &[f64]) {
        self.x.extend_from_slice(x);
        self.lp.extend_from_slice(lp);
    }
}

impl Memory {
    /// Of an ensemble of `walkers` in `dim` dimensions; at most `most` draws of each of its chains.
    pub(super) fn new(walkers: usize, dim: usize, most: usize) -> Self {
        Self {
            pieces: Vec::new(),
            walkers,
            dim,
            most,
            held: 0,
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

    /// Takes the draws out of a block.
    pub(super) fn take(&mut self, block: &mut Block) {
        let piece = Piece {
            x: std::mem::take(&mut block.x),
            lp: std::mem::take(&mut block.lp),
        };
        let count = piece.lp.len() / self.walkers;
        if self.stride == 1 && self.held + count <= self.most {
            self.pieces.push(piece);
            self.held += count;
            self.seen += count;
            return;
        }
        for (x, lp) in piece.rows(self.walkers, self.dim) {
            self.push(x, lp);
        }
    }

    /// Takes one draw of all walkers: parameter x walker, and walker.
    pub(super) fn push(&mut self, x: &[f64], lp: &[f64]) {
        self.seen += 1;
        if !self.seen.is_multiple_of(self.stride) {
            return;
        }
        match self.pieces.last_mut() {
            Some(piece) => piece.push(x, lp),
            None => self.pieces.push(Piece {
                x: x.to_vec(),
                lp: lp.to_vec(),
            }),
        }
        self.held += 1;
        if self.held > self.most {
            self.halve();
        }
    }

    /// Keeps the draws that the doubled stride would have kept.
    fn halve(&mut self) {
        let mut kept = Piece::default();
        let mut count = 0;
        // Each piece is let go as soon as it is read.
        for piece in std::mem::take(&mut self.pieces) {
            for (x, lp) in piece.rows(self.walkers, self.dim) {
                count += 1;
                if count % 2 == 0 {
                    kept.push(x, lp);
                }
            }
        }
        self.pieces.push(kept);
        self.held /= 2;
        self.stride *= 2;
    }

    /// Brings what is held to chain x draw x parameter, and chain x draw.
    fn transpose(&self, values: &mut [f64], lp: &mut [f64]) {
        /// Draws at a time, so that they stay in the cache while every chain takes its own.
        const TILE: usize = 16;
        let (walkers, dim) = (self.walkers, self.dim);
        let mut from = 0;
        for piece in &self.pieces {
            let tiles = piece.x.chunks(TILE * walkers * dim);
            for (x, row) in tiles.zip(piece.lp.chunks(TILE * walkers)) {
                let count = row.len() / walkers;
                for walker in 0..walkers {
                    let at = walker * self.held + from;
                    let points = values[at * dim..(at + count) * dim].chunks_exact_mut(dim);
                    for (point, draw) in points.zip(x.chunks_exact(walkers * dim)) {
                        for (value, column) in point.iter_mut().zip(draw.chunks_exact(walkers)) {
                            *value = column[walker];
                        }
                    }
                    let draws = row.chunks_exact(walkers);
                    for (value, draw) in lp[at..at + count].iter_mut().zip(draws) {
                        *value = draw[walker];
                    }
                }
                from += count;
            }
        }
    }
}

/// The draws held of all ensembles, chain by chain.
pub(super) fn draws(memories: &[Memory], names: &[String]) -> Result<Draws> {
    let total: usize = memories.iter().map(|m| m.held * m.walkers).sum();
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
