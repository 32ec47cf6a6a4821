//! Keeping draws while a run goes: in memory what the diagnostics need, on disk everything.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayon::iter::ParallelIterator;
use serde_json::Value;

use super::checkpoint::{Checkpoint, Warm};
use super::density::LogDensity;
use super::memory::{Memory, MemoryShare};
use super::{Block, EnsembleState};
use crate::chain::{Layout, Store};
use crate::error::{Error, Result};
use crate::files::{KeptStages, STAGES};

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

impl Keeping {
    /// In a folder, beside whatever else is there.
    pub fn within(folder: &Path, identity: Value, resume: bool) -> Self {
        Self {
            store: folder.join("chain.zarr"),
            checkpoint: folder.join("checkpoint"),
            identity,
            resume,
            observed: Vec::new(),
        }
    }

    /// Where finished stages beside the chains are kept.
    pub fn stages(&self) -> KeptStages {
        let folder = self.checkpoint.with_file_name(STAGES);
        KeptStages::within(folder, &self.identity, self.resume)
    }
}

/// The store and the checkpoint of a run.
pub(super) struct Keeper {
    keeping: Keeping,
    store: Store,
    flushed: Instant,
}

impl Keeper {
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

    /// Goes on with an old one: its checkpoint, with the draws put into `memory`, at most `most` of each chain. None if
    /// there is nothing to go on from, because the run was killed before its first flush.
    pub(super) fn reopen(
        keeping: &Keeping,
        layout: Layout,
        target: &dyn LogDensity,
        memory: &mut Memory,
        most: usize,
    ) -> Result<Option<(Self, Checkpoint)>> {
        if !keeping.checkpoint.exists() {
            return abandoned(keeping).map(|()| None);
        }
        let checkpoint = Checkpoint::read(&keeping.checkpoint, &keeping.identity)?;
        same_target(keeping, &layout, target, &checkpoint)?;
        memory.reserve(checkpoint.stored.0.min(most));
        let mut shares: Vec<MemoryShare<'_>> = memory.shares().collect();
        let store = Store::reopen(
            &keeping.store,
            layout,
            keeping.identity.clone(),
            checkpoint.stored,
            &mut |ensemble, x, lp| shares[ensemble].push(x, lp),
        )?;
        if let Some(count) = shares.first().map(MemoryShare::count) {
            memory.taken(count);
        }
        let keeper = Self {
            store,
            keeping: keeping.clone(),
            flushed: Instant::now(),
        };
        Ok(Some((keeper, checkpoint)))
    }

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
        states: &[EnsembleState],
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
        .map_err(|e| Error::unwritable(place.display(), "a writable folder").found(e))
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
            let now = target.value(x)?;
            if now.to_bits() != lp.to_bits() {
                return Err(Error::input(place, format!("the log density {now} at {x:?}"))
                    .found(lp)
                    .hint("the posterior is another one: other data, another program, or another kind of processor"));
            }
        }
    }
    Ok(())
}
