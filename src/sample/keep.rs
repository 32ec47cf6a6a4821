//! Keeping draws while a run goes: in memory what the diagnostics need, on disk everything.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::checkpoint::{Checkpoint, Warm};
use super::{Block, State};
use crate::chain::{Draws, Layout, Store};
use crate::error::{Error, Result};
use crate::infer::LogDensity;

/// Between two flushes; a span of work between them takes a quarter of it.
pub(super) const PATIENCE: Duration = Duration::from_millis(1000);

/// Where a run is stored, and what makes it the same run.
#[derive(Debug, Clone)]
pub struct Keeping {
    /// The chain store (`chain.zarr`).
    pub store: PathBuf,
    /// The checkpoint beside it.
    pub checkpoint: PathBuf,
    /// What a resumed run must share: model, data, seed, sampler, and so on.
    pub identity: Value,
    /// Go on from what is there.
    pub resume: bool,
    /// Measured numbers for the store's `observed_data`, by name.
    pub observed: Vec<(String, Vec<f64>)>,
}

/// The store and the checkpoint of a run.
pub(super) struct Keeper {
    keeping: Keeping,
    store: Store,
    flushed: Instant,
}

impl Keeper {
    /// Makes a new store.
    pub(super) fn create(keeping: &Keeping, layout: Layout) -> Result<Self> {
        if keeping.checkpoint.exists() {
            return Err(
                Error::input(keeping.checkpoint.display(), "no checkpoint of another run")
                    .found("one"),
            );
        }
        Ok(Self {
            store: Store::create(&keeping.store, layout, keeping.identity.clone())?,
            keeping: keeping.clone(),
            flushed: Instant::now(),
        })
    }

    /// Goes on with an old one: its checkpoint, with all draws put into `memory`. None if there is nothing to go on
    /// from, because the run was killed before its first flush.
    pub(super) fn reopen(
        keeping: &Keeping,
        layout: Layout,
        target: &dyn LogDensity,
        memory: &mut Memory,
    ) -> Result<Option<(Self, Checkpoint)>> {
        if !keeping.checkpoint.exists() {
            return abandoned(keeping).map(|()| None);
        }
        let checkpoint = Checkpoint::read(&keeping.checkpoint, &keeping.identity)?;
        same_target(keeping, &layout, target, &checkpoint)?;
        let (walkers, dim) = (layout.walkers, layout.names.len());
        let store = Store::reopen(
            &keeping.store,
            layout,
            keeping.identity.clone(),
            checkpoint.stored,
            &mut |ensemble, x, lp| memory.push(ensemble, x, lp, walkers, dim),
        )?;
        memory.rows = checkpoint.stored.0;
        let keeper = Self {
            store,
            keeping: keeping.clone(),
            flushed: Instant::now(),
        };
        Ok(Some((keeper, checkpoint)))
    }

    /// Records blocks of draws.
    pub(super) fn record(&mut self, blocks: &[Block]) -> Result<()> {
        let parts: Vec<(&[f64], &[f64])> = blocks.iter().map(|b| (&*b.x, &*b.lp)).collect();
        self.store.record(&parts)
    }

    /// Whether it is time for a flush.
    pub(super) fn due(&self) -> bool {
        self.flushed.elapsed() >= PATIENCE
    }

    /// Draws first, the checkpoint last: what the checkpoint tells of is there.
    pub(super) fn flush(
        &mut self,
        warm: Warm,
        states: &[State],
        totals: &[Block],
        acceptance: &[f64],
    ) -> Result<()> {
        self.store.flush(acceptance)?;
        let checkpoint = Checkpoint {
            warm,
            states: states.to_vec(),
            totals: totals.to_vec(),
            stored: (self.store.draws(), self.store.digest()),
        };
        checkpoint.write(&self.keeping.checkpoint, &self.keeping.identity)?;
        self.flushed = Instant::now();
        Ok(())
    }
}

/// A store without a checkpoint is of a run killed before its first flush: it holds no draws, and is made anew.
fn abandoned(keeping: &Keeping) -> Result<()> {
    let place = &keeping.store;
    if !place.exists() {
        return Ok(());
    }
    let ours = crate::chain::read_zarr(place, None).map_or_else(
        // The metadata come last, so a kill may leave a store without them.
        |_| !place.join("zarr.json").exists(),
        |draws| draws.is_empty(),
    );
    if !ours {
        return Err(
            Error::input(place.display(), "a checkpoint beside the chain store")
                .found("none")
                .hint("without it the run cannot go on; the store is left as it is"),
        );
    }
    std::fs::remove_dir_all(place)
        .map_err(|e| Error::input(place.display(), "a writable folder").found(e))
}

/// The posterior must give the stored log densities, bit by bit.
fn same_target(
    keeping: &Keeping,
    layout: &Layout,
    target: &dyn LogDensity,
    checkpoint: &Checkpoint,
) -> Result<()> {
    let dim = target.dim();
    let place = keeping.checkpoint.display();
    let walkers = layout.walkers;
    let shape = checkpoint.states.len() == layout.ensembles
        && checkpoint
            .states
            .iter()
            .all(|s| s.lp.len() == walkers && s.x.len() == walkers * dim);
    if !shape {
        return Err(Error::input(
            place,
            format!(
                "{} ensembles of {walkers} walkers in {dim} dimensions",
                layout.ensembles
            ),
        )
        .found("others"));
    }
    for state in &checkpoint.states {
        for (x, lp) in state.x.chunks_exact(dim).zip(&state.lp) {
            let now = target.log_density(x);
            if now.to_bits() != lp.to_bits() {
                return Err(Error::input(place, format!("the log density {now} at {x:?}"))
                    .found(lp)
                    .hint("the posterior is another one: other data, another program, or another kind of processor"));
            }
        }
    }
    Ok(())
}

/// Draws in memory, at most a given number: beyond it every second one is let go, again and again.
pub(super) struct Memory {
    x: Vec<Vec<f64>>,
    lp: Vec<Vec<f64>>,
    most: usize,
    stride: usize,
    /// Draws of each chain so far, kept or not.
    pub(super) rows: usize,
    seen: Vec<usize>,
}

impl Memory {
    pub(super) fn new(ensembles: usize, most: usize) -> Self {
        Self {
            x: vec![Vec::new(); ensembles],
            lp: vec![Vec::new(); ensembles],
            most,
            stride: 1,
            rows: 0,
            seen: vec![0; ensembles],
        }
    }

    /// Draws from one kept one to the next.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Takes the draws of a span.
    pub(super) fn take(&mut self, blocks: &[Block], walkers: usize, dim: usize) {
        let count = blocks.first().map_or(0, |b| b.lp.len() / walkers);
        for row in 0..count {
            for (ensemble, block) in blocks.iter().enumerate() {
                let at = row * walkers..(row + 1) * walkers;
                let x = &block.x[at.start * dim..at.end * dim];
                self.push(ensemble, x, &block.lp[at], walkers, dim);
            }
        }
        self.rows += count;
    }

    /// Takes one draw of all walkers of an ensemble; ensembles come in turn.
    pub(super) fn push(
        &mut self,
        ensemble: usize,
        x: &[f64],
        lp: &[f64],
        walkers: usize,
        dim: usize,
    ) {
        self.seen[ensemble] += 1;
        if !self.seen[ensemble].is_multiple_of(self.stride) {
            return;
        }
        self.x[ensemble].extend_from_slice(x);
        self.lp[ensemble].extend_from_slice(lp);
        let last = ensemble + 1 == self.x.len();
        if last && self.lp.iter().map(Vec::len).sum::<usize>() > self.most {
            self.halve(walkers, dim);
        }
    }

    /// Keeps the draws that the doubled stride would have kept.
    fn halve(&mut self, walkers: usize, dim: usize) {
        for (values, width) in self
            .x
            .iter_mut()
            .map(|x| (x, walkers * dim))
            .chain(self.lp.iter_mut().map(|lp| (lp, walkers)))
        {
            let rows = values.len() / width / 2;
            for row in 0..rows {
                values.copy_within((2 * row + 1) * width..(2 * row + 2) * width, row * width);
            }
            values.truncate(rows * width);
        }
        self.stride *= 2;
    }

    /// What is kept, chain by chain.
    pub(super) fn draws(&self, names: &[String], walkers: usize) -> Result<Draws> {
        let blocks: Vec<(&[f64], &[f64])> = self
            .x
            .iter()
            .zip(&self.lp)
            .map(|(x, lp)| (&**x, &**lp))
            .collect();
        collect(names, walkers, &blocks)
    }
}

/// Brings positions and log densities from [draw][walker] to [chain][draw].
pub(super) fn collect(
    names: &[String],
    walkers: usize,
    blocks: &[(&[f64], &[f64])],
) -> Result<Draws> {
    let dim = names.len();
    let total: usize = blocks.iter().map(|(_, lp)| lp.len()).sum();
    let mut values = Vec::with_capacity(total * dim);
    let mut all = Vec::with_capacity(total);
    for (x, lp) in blocks {
        let draws = lp.len() / walkers;
        for walker in 0..walkers {
            for row in (0..draws).map(|draw| draw * walkers + walker) {
                values.extend_from_slice(&x[row * dim..(row + 1) * dim]);
                all.push(lp[row]);
            }
        }
    }
    let ensemble = (0..walkers * blocks.len())
        .map(|chain| chain / walkers)
        .collect();
    Draws::new(names.to_vec(), ensemble, values, all)
}
