//! Draws held in memory while a run goes: of a long run only every second, fourth, ... one.
//!
//! They lie where [`Draws`] wants them, so that nothing is copied when the run looks at them: to touch fresh memory once
//! more costs as much as the draws themselves.

use rayon::prelude::*;

use super::Block;
use crate::chain::Draws;
use crate::error::Result;

/// Draws of all ensembles, chain by chain, each chain with room for the same number: beyond it every second draw is let
/// go, again and again.
pub struct Memory {
    /// Chain x room x parameter.
    values: Vec<f64>,
    /// Chain x room.
    lp: Vec<f64>,
    shape: MemoryShape,
    ensembles: usize,
    count: Count,
}

/// Sizes of one ensemble.
#[derive(Debug, Clone, Copy)]
struct MemoryShape {
    walkers: usize,
    dim: usize,
    /// Draws of a chain that there is room for.
    room: usize,
}

/// How far the draws of each chain have come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Count {
    held: usize,
    /// Draws from one held one to the next.
    stride: usize,
    /// Draws so far, held or not.
    seen: usize,
}

/// The part of one ensemble, which takes draws beside the others.
pub struct MemoryShare<'a> {
    values: &'a mut [f64],
    lp: &'a mut [f64],
    shape: MemoryShape,
    count: Count,
}

impl Memory {
    /// Of `ensembles` ensembles of `walkers` in `dim` dimensions, without room yet.
    pub fn new(ensembles: usize, walkers: usize, dim: usize) -> Self {
        Self {
            values: Vec::new(),
            lp: Vec::new(),
            shape: MemoryShape {
                walkers,
                dim,
                room: 0,
            },
            ensembles,
            count: Count {
                held: 0,
                stride: 1,
                seen: 0,
            },
        }
    }

    /// Draws from one held one to the next.
    pub fn stride(&self) -> usize {
        self.count.stride
    }

    /// Draws of each chain so far, held or not.
    pub fn seen(&self) -> usize {
        self.count.seen
    }

    /// Room for `room` draws of each chain, unless there is more already.
    pub fn reserve(&mut self, room: usize) {
        let from = self.shape.room;
        if room <= from {
            return;
        }
        let (chains, dim, held) = (self.chains(), self.shape.dim, self.count.held);
        if held == 0 {
            // Zeros that nobody has touched take no memory.
            (self.values, self.lp) = (vec![0.0; chains * room * dim], vec![0.0; chains * room]);
        } else {
            spread(
                &mut self.values,
                chains,
                [from * dim, room * dim],
                held * dim,
            );
            spread(&mut self.lp, chains, [from, room], held);
        }
        self.shape.room = room;
    }

    /// The parts of the ensembles, and the count that [`Memory::taken`] wants to hear of again.
    pub fn shares(&mut self) -> impl IndexedParallelIterator<Item = MemoryShare<'_>> {
        let (shape, count) = (self.shape, self.count);
        let each = (shape.walkers * shape.room).max(1);
        self.values
            .par_chunks_exact_mut(each * shape.dim)
            .zip(self.lp.par_chunks_exact_mut(each))
            .map(move |(values, lp)| MemoryShare {
                values,
                lp,
                shape,
                count,
            })
    }

    /// Every share has come as far as `count`.
    pub fn taken(&mut self, count: Count) {
        self.count = count;
    }

    /// Lends the draws held; [`Memory::restore`] takes them back.
    pub fn lend(&mut self, names: &[String]) -> Result<Draws> {
        let (chains, dim, held) = (self.chains(), self.shape.dim, self.count.held);
        let (mut values, mut lp) = (
            std::mem::take(&mut self.values),
            std::mem::take(&mut self.lp),
        );
        pack(&mut values, chains, self.shape.room * dim, held * dim);
        pack(&mut lp, chains, self.shape.room, held);
        self.shape.room = 0;
        let ensemble = (0..chains).map(|chain| chain / self.shape.walkers);
        Draws::new(names.to_vec(), ensemble.collect(), values, lp)
    }

    /// Takes lent draws back.
    pub fn restore(&mut self, draws: Draws) {
        (self.values, self.lp) = draws.into_arrays();
        self.shape.room = self.count.held;
    }

    fn chains(&self) -> usize {
        self.ensembles * self.shape.walkers
    }
}

/// Moves the first `held` numbers of rows `from` long to rows `to` long.
fn spread(values: &mut Vec<f64>, rows: usize, [from, to]: [usize; 2], held: usize) {
    values.resize(rows * to, 0.0);
    for row in (1..rows).rev() {
        values.copy_within(row * from..row * from + held, row * to);
    }
}

/// Keeps the first `held` numbers of each of the rows.
fn pack(values: &mut Vec<f64>, rows: usize, length: usize, held: usize) {
    if held < length {
        for row in 1..rows {
            values.copy_within(row * length..row * length + held, row * held);
        }
        values.truncate(rows * held);
    }
}

impl MemoryShare<'_> {
    /// How far the draws have come.
    pub fn count(&self) -> Count {
        self.count
    }

    /// Takes the draws of a block.
    pub fn take(&mut self, block: &Block) {
        /// Draws at a time, so that they stay in the cache while every chain takes its own.
        const TILE: usize = 16;
        let MemoryShape { walkers, dim, .. } = self.shape;
        let tiles = block.x.chunks(TILE * walkers * dim);
        for (x, lp) in tiles.zip(block.lp.chunks(TILE * walkers)) {
            let draws = lp.len() / walkers;
            if self.count.stride == 1 && self.count.held + draws <= self.shape.room {
                self.put(x, lp);
                self.count.seen += draws;
            } else {
                for (x, lp) in x.chunks_exact(walkers * dim).zip(lp.chunks_exact(walkers)) {
                    self.push(x, lp);
                }
            }
        }
    }

    /// Takes one draw of all walkers: parameter x walker, and walker.
    pub fn push(&mut self, x: &[f64], lp: &[f64]) {
        self.count.seen += 1;
        if !self.count.seen.is_multiple_of(self.count.stride) {
            return;
        }
        if self.count.held == self.shape.room {
            self.halve();
            if !self.count.seen.is_multiple_of(self.count.stride) {
                return;
            }
        }
        self.put(x, lp);
    }

    /// Holds draws for which there is room: draw x parameter x walker, and draw x walker.
    fn put(&mut self, x: &[f64], lp: &[f64]) {
        let MemoryShape { walkers, dim, room } = self.shape;
        let (from, count) = (self.count.held, lp.len() / walkers);
        for walker in 0..walkers {
            let at = walker * room + from;
            let points = self.values[at * dim..(at + count) * dim].chunks_exact_mut(dim);
            for (point, draw) in points.zip(x.chunks_exact(walkers * dim)) {
                for (value, column) in point.iter_mut().zip(draw.chunks_exact(walkers)) {
                    *value = column[walker];
                }
            }
            let draws = lp.chunks_exact(walkers);
            for (value, draw) in self.lp[at..at + count].iter_mut().zip(draws) {
                *value = draw[walker];
            }
        }
        self.count.held += count;
    }

    /// Keeps the draws that the doubled stride would have kept.
    fn halve(&mut self) {
        let MemoryShape { dim, room, .. } = self.shape;
        let kept = self.count.held / 2;
        for values in self.values.chunks_exact_mut(room * dim) {
            (0..kept)
                .for_each(|k| values.copy_within((2 * k + 1) * dim..(2 * k + 2) * dim, k * dim));
        }
        for lp in self.lp.chunks_exact_mut(room) {
            (0..kept).for_each(|k| lp[k] = lp[2 * k + 1]);
        }
        self.count.held = kept;
        self.count.stride *= 2;
    }
}
