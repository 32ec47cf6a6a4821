//! The replicates of a calibration: what is planned of them, and those that a record lacks.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::record::{Record, Share};
use crate::error::Result;
use crate::progress::Progress;

/// What is calibrated, over how many replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReplicatePlan {
    pub replicates: usize,
    /// Correlation length of the noise, mm; 0 for white noise.
    pub correlation_mm: f64,
    pub seed: u64,
    /// Points along a side of the lattice.
    pub grid: usize,
    /// Which of the replicates are run; the others may be in records beside.
    #[serde(skip)]
    pub share: Option<Share>,
}

impl ReplicatePlan {
    /// Replicates of the share that are not done.
    pub fn todo(&self, is_done: impl Fn(usize) -> bool) -> Vec<usize> {
        let own = (0..self.replicates).filter(|&k| self.share.is_none_or(|s| s.has(k)));
        own.filter(|&k| !is_done(k)).collect()
    }

    /// The seed of a replicate, for a purpose.
    pub fn seed_of(&self, replicate: usize, purpose: u64) -> u64 {
        let mut rng = Pcg64Dxsm::seed_from_u64(self.seed);
        let base: u64 = rng.random();
        base.wrapping_add((replicate as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
            .wrapping_add(purpose.wrapping_mul(0xd1b5_4a32_d192_ed03))
    }
}

/// What is one of a plan's replicates.
pub(super) trait Numbered: Serialize + DeserializeOwned + Send {
    /// Which it is.
    fn replicate(&self) -> usize;
}

/// Do what the record at a path lacks of a plan's replicates, as many at a time as there are threads. `of` is what else the record is of.
///
/// # Errors
/// A record of something else; those of `one`.
pub(super) fn replicates<T: Numbered>(
    (path, of): (&Path, &impl Serialize),
    plan: &ReplicatePlan,
    (what, one): (&str, &(dyn Fn(usize) -> Result<T> + Sync)),
    progress: &dyn Progress,
) -> Result<Vec<T>> {
    // a longer or shorter record of the same plan is the same record
    let any_length = ReplicatePlan {
        replicates: 0,
        ..plan.clone()
    };
    let (mut record, mut done) = Record::open_among::<T>(path, &(any_length, of), plan.share)?;
    let todo = plan.todo(|k| done.iter().any(|r| r.replicate() == k));
    progress.begin(what, Some(todo.len() as u64));
    for some in todo.chunks(rayon::current_num_threads()) {
        let of = |k: &usize| {
            let found = one(*k);
            progress.step();
            found
        };
        let found: Vec<Result<T>> = some.par_iter().map(of).collect();
        for found in found {
            let found = found?;
            record.add(&found)?;
            done.push(found);
        }
    }
    progress.end();
    done.retain(|r| r.replicate() < plan.replicates);
    done.sort_by_key(Numbered::replicate);
    done.dedup_by_key(|r| r.replicate());
    Ok(done)
}
