//! `run.json`, what a run was, and `truth.json`, what simulated data were made of.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::json::{Keyed, load};
use crate::error::{Error, Result};
use crate::field::unreadable;
use crate::files::hex;
use crate::parameter::Parameter;
use crate::progress::StageCost;

/// `run.json` of a finished run.
#[derive(Debug, Serialize, Deserialize)]
pub struct Manifest {
    pub program: String,
    pub version: String,
    pub command: Vec<String>,
    pub seed: u64,
    /// SHA-256 of every input file by path, the model's first.
    pub inputs_sha256: Keyed<String>,
    /// Seconds that the run took.
    pub seconds: f64,
    /// What each of a loop's stages cost; writing the report is not among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageCost>,
}

impl Manifest {
    /// The manifest in the folder of a finished run.
    ///
    /// # Errors
    /// The input's fault, with the file and the key, if the run is not finished or the file cannot be read.
    pub fn load(folder: &Path) -> Result<Self> {
        load(folder, "run.json").map_err(|e: Error| {
            e.hint(
                "an interrupted run is gone on with by the same command with --out FOLDER --resume",
            )
        })
    }
}

/// `truth.json` beside simulated data, which other programs may have written: what it does not say is not known.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct KnownTruth(Value);

impl KnownTruth {
    /// What `truth.json` in a folder says; nothing if there is none.
    ///
    /// # Errors
    /// The input's fault, with the file, if it is no JSON.
    pub fn load(folder: &Path) -> Result<Self> {
        match folder.join("truth.json").is_file() {
            true => load(folder, "truth.json"),
            false => Ok(Self::default()),
        }
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.0.is_null()
    }

    /// The true value of a constant or of an effect's amplitude (`effect.parameter`; 0 if the effect did not act).
    pub fn of(&self, name: &str) -> Option<f64> {
        let parameter = Parameter::read(name);
        let Some(effect) = &parameter.effect else {
            return self.0.get("constants")?.get(name)?.as_f64();
        };
        match self.0.get("effects")?.as_object()?.get(effect) {
            None => Some(0.0),
            Some(amplitudes) => amplitudes.get(&parameter.own)?.as_f64(),
        }
    }
}

/// SHA-256 of files, by path.
///
/// # Errors
/// The input's fault, with the file, if it cannot be read.
pub fn hashes<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<Keyed<String>> {
    files
        .map(|path| Ok((path.display().to_string(), hash(path)?)))
        .collect()
}

fn hash(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| unreadable(path, &e))?;
    Ok(hex(&Sha256::digest(bytes)))
}
