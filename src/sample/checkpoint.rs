//! What a run needs to go on after a kill: written beside the chain store at every flush, in one step.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{Block, EnsembleState};
use crate::chain::MoveTally;
use crate::error::{Error, Result};
use crate::files;
use crate::files::hex;

/// Version of the file's format.
pub const FORMAT: &str = "plychain-checkpoint/2";

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
#[derive(Debug)]
pub struct Checkpoint {
    pub warm: Warm,
    /// State of each ensemble.
    pub states: Vec<EnsembleState>,
    /// Tallies of each ensemble since warm-up, without draws.
    pub totals: Vec<Block>,
    /// Draws of each chain in the store, and their digest.
    pub stored: (usize, u64),
}

#[derive(Serialize, Deserialize)]
struct CheckpointFile {
    format: String,
    identity: Value,
    warm: Warm,
    draws: usize,
    digest: u64,
    states: Vec<EnsembleState>,
    totals: Vec<Totals>,
}

#[derive(Serialize, Deserialize)]
struct Totals {
    accepted: Vec<u64>,
    moves: Vec<(String, u64, u64)>,
    nan: u64,
    evaluations: u64,
}

impl Checkpoint {
    /// Writes the file; `identity` is what a run that resumes must share.
    ///
    /// # Errors
    /// The input's fault if it cannot be written.
    pub fn write(&self, path: &Path, identity: &Value) -> Result<()> {
        let totals = self.totals.iter().map(|t| Totals {
            accepted: t.accepted.clone(),
            moves: t
                .moves
                .iter()
                .map(|m| (m.name.clone(), m.proposed, m.accepted))
                .collect(),
            nan: t.nan,
            evaluations: t.evaluations,
        });
        let file = CheckpointFile {
            format: FORMAT.into(),
            identity: identity.clone(),
            warm: self.warm,
            draws: self.stored.0,
            digest: self.stored.1,
            states: self.states.clone(),
            totals: totals.collect(),
        };
        let text = serde_json::to_string(&file)
            .map_err(|e| Error::program("checkpoint", "numbers that JSON can hold").found(e))?;
        let sum = hex(&Sha256::digest(&text));
        files::replace(path, format!("{sum}\n{text}\n"))
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
        let text = std::fs::read_to_string(path).map_err(|e| damaged(&e))?;
        let (sum, text) = text
            .split_once('\n')
            .ok_or_else(|| damaged(&"a cut file"))?;
        let text = text.trim_end();
        if hex(&Sha256::digest(text)) != sum {
            return Err(damaged(&"a file whose checksum is wrong"));
        }
        let value: Value = serde_json::from_str(text).map_err(|e| damaged(&e))?;
        if value["format"] != FORMAT {
            return Err(
                Error::input(path.display(), format!("format {FORMAT}")).found(&value["format"])
            );
        }
        same_run(path, identity, &value["identity"])?;
        let file: CheckpointFile = serde_json::from_value(value).map_err(|e| damaged(&e))?;
        let totals = file.totals.iter().map(|t| Block {
            accepted: t.accepted.clone(),
            moves: t.moves.iter().map(tally).collect(),
            nan: t.nan,
            evaluations: t.evaluations,
            ..Block::default()
        });
        Ok(Self {
            warm: file.warm,
            states: file.states,
            totals: totals.collect(),
            stored: (file.draws, file.digest),
        })
    }
}

fn tally((name, proposed, accepted): &(String, u64, u64)) -> MoveTally {
    MoveTally {
        name: name.clone(),
        proposed: *proposed,
        accepted: *accepted,
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
