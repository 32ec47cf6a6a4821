//! What a run needs to go on after a kill: written beside the chain store at every flush, in one step.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Block, EnsembleState};
use crate::error::{Error, Result};
use crate::files;

/// Version of the file's format.
pub const FORMAT: &str = "plychain-checkpoint/3";

/// How far warm-up has come.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Warm {
    /// Steps of complete windows.
    pub steps: usize,
    /// Steps between stored draws.
    pub thin: usize,
    /// Whether the last window looked stationary.
    pub settled: bool,
    pub over: bool,
}

/// Everything a run needs to go on, apart from its draws.
#[derive(Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    pub warm: Warm,
    /// State of each ensemble.
    pub states: Vec<EnsembleState>,
    /// Tallies of each ensemble since warm-up, without draws.
    pub totals: Vec<Block>,
    /// Draws of each chain in the store, and their digest.
    pub stored: (usize, u64),
}

impl Checkpoint {
    /// Writes the file; `identity` is what a run that resumes must share.
    ///
    /// # Errors
    /// The input's fault if it cannot be written.
    pub fn write(&self, path: &Path, identity: &Value) -> Result<()> {
        files::replace(path, files::sealed(FORMAT, &(identity, self))?)
    }

    /// Reads the file of a run of the same `identity`.
    ///
    /// # Errors
    /// The input's fault: a damaged file, another format, another run.
    pub fn read(path: &Path, identity: &Value) -> Result<Self> {
        let damaged = |found: &dyn std::fmt::Display| {
            Error::input(path.display(), "the checkpoint of a run")
                .found(found)
                .hint("it is damaged and left as it is: start a new run in another folder")
        };
        let bytes = std::fs::read(path).map_err(|e| damaged(&e))?;
        if !bytes.starts_with(FORMAT.as_bytes()) {
            return Err(
                Error::input(path.display(), format!("a checkpoint of format {FORMAT}"))
                    .found("one of another version, or another file")
                    .hint("start a new run in another folder"),
            );
        }
        let (theirs, checkpoint): (Value, Self) = files::unsealed(FORMAT, &bytes)
            .ok_or_else(|| damaged(&"a file whose checksum is wrong"))?;
        same_run(path, identity, &theirs)?;
        Ok(checkpoint)
    }
}

/// Names the first thing in which two runs differ.
fn same_run(path: &Path, ours: &Value, theirs: &Value) -> Result<()> {
    if ours == theirs {
        return Ok(());
    }
    let empty = serde_json::Map::new();
    let (a, b) = (
        ours.as_object().unwrap_or(&empty),
        theirs.as_object().unwrap_or(&empty),
    );
    let key = a.keys().chain(b.keys()).find(|k| a.get(*k) != b.get(*k));
    let key = key.map_or("identity", |k| k.as_str());
    let show = |v: Option<&Value>| v.map_or("nothing".into(), ToString::to_string);
    Err(Error::input(
        format!("{}: {key}", path.display()),
        format!("{}, as this run has", show(a.get(key))),
    )
    .found(show(b.get(key)))
    .hint("this folder belongs to another run: resume with the same model, data, seed and sampler, or choose another folder"))
}
