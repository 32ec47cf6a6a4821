//! Records of replicates: a header that says of what, and one line of JSON each.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::files;
use crate::progress::Progress;

/// Share K of N of the replicates, counted from 1: every N-th. It has a record of its own beside the whole one, so that no two processes write
/// one file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    pub task: usize,
    pub of: usize,
}

impl Share {
    pub fn has(self, replicate: usize) -> bool {
        replicate % self.of == self.task - 1
    }

    /// Its record beside that of all.
    fn path(self, whole: &Path) -> PathBuf {
        whole.with_extension(format!("share-{}-of-{}.jsonl", self.task, self.of))
    }
}

/// Records of shares beside that of all, whatever their number.
fn shares(whole: &Path) -> Vec<PathBuf> {
    let stem = whole.file_stem().unwrap_or_default().to_string_lossy();
    let begin = format!("{stem}.share-");
    let folder = whole.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|p| {
            let name = p.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(&begin) && name.ends_with(".jsonl")
        })
        .collect();
    paths.sort();
    paths
}

/// A record that replicates are added to.
pub struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
    /// Open the record of a share, or of all, and read what it and the records beside it hold.
    ///
    /// # Errors
    /// Those of [`Record::open`], of any of them.
    pub fn open_among<T: Serialize + DeserializeOwned>(
        whole: &Path,
        of: &impl Serialize,
        share: Option<Share>,
    ) -> Result<(Self, Vec<T>)> {
        let own = share.map_or_else(|| whole.to_path_buf(), |s| s.path(whole));
        let (record, mut known) = Self::open(&own, of)?;
        let mut beside = shares(whole);
        beside.push(whole.to_path_buf());
        for path in beside.iter().filter(|p| **p != own && p.exists()) {
            known.extend(read(path, &line(of)?)?.unwrap_or_default());
        }
        Ok((record, known))
    }

    /// Read a record, or begin one. A last line that was cut off by a kill is dropped.
    ///
    /// # Errors
    /// A record of something else; a place that cannot be read or written.
    pub fn open<T: Serialize + DeserializeOwned>(
        path: &Path,
        of: &impl Serialize,
    ) -> Result<(Self, Vec<T>)> {
        let failed = |e: std::io::Error| {
            Error::input(path.display(), "a readable and writable file").found(e)
        };
        let header = line(of)?;
        let known: Vec<T> = read(path, &header)?.unwrap_or_default();
        let mut whole = header + "\n";
        for replicate in &known {
            whole += &line(replicate)?;
            whole.push('\n');
        }
        files::replace(path, whole)?;
        let file = OpenOptions::new().append(true).open(path).map_err(failed)?;
        let path = path.to_path_buf();
        Ok((Self { path, file }, known))
    }

    /// Add a replicate.
    ///
    /// # Errors
    /// Of the input: a file that cannot be written.
    pub fn add(&mut self, replicate: &impl Serialize) -> Result<()> {
        let line = line(replicate)? + "\n";
        let written = self.file.write_all(line.as_bytes());
        written.map_err(|e| Error::input(self.path.display(), "a writable file").found(e))
    }
}

/// What a record of the same as `header` says holds; none if there is no record.
fn read<T: DeserializeOwned>(path: &Path, header: &str) -> Result<Option<Vec<T>>> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => {
            return Err(Error::input(path.display(), "a readable and writable file").found(e));
        }
    };
    let mut lines = text.lines();
    if lines.next().is_some_and(|first| first != header) {
        let expected = "a record of the same model, seed, noise and grid";
        return Err(Error::input(path.display(), expected)
            .found("another one")
            .hint("choose another --out; nothing was changed"));
    }
    Ok(Some(
        lines.map_while(|l| serde_json::from_str(l).ok()).collect(),
    ))
}

fn line(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value)
        .map_err(|e| Error::program("calibration", "numbers that JSON can hold").found(e))
}

/// What is calibrated, over how many replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReplicatePlan {
    pub replicates: usize,
    /// Correlation length of the noise, mm; 0 for white noise.
    pub correlation_mm: f64,
    /// Fields by the reduced model instead of the finite elements.
    pub reduced: bool,
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
