//! Stages of a run that are finished, each in a file of its own: a run that goes on takes them up instead of doing them again.
//!
//! A file belongs to what the stage was made of. Its name has the stage and the digest of the run's identity (model, data, version, seed)
//! and of everything that went into it. Its first line has the digest of what follows, so that a damaged file is known as one.

use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{hex, make_folder, replace};
use crate::error::{Error, Result};
use crate::progress::Progress;

/// The folder of a run's finished stages, beside its chains.
pub const STAGES: &str = "stages";

/// Begins every file.
const FORMAT: &str = "plychain-stage/3";

/// Where finished stages are kept; nowhere by default.
#[derive(Debug, Default)]
pub struct KeptStages {
    place: Option<(PathBuf, String)>,
    resume: bool,
}

impl KeptStages {
    /// In a folder, for runs of one `identity`; what is there already is taken up where a run is to `resume`.
    pub fn within(folder: PathBuf, identity: &Value, resume: bool) -> Self {
        Self {
            place: Some((folder, identity.to_string())),
            resume,
        }
    }

    /// A stage that was finished before, or `make` it and keep it. The name says which stage it is, `of` is all that goes into it.
    ///
    /// # Errors
    /// Those of `make`; a folder that cannot be written.
    pub fn stage<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        of: &impl Serialize,
        make: impl FnOnce() -> Result<T>,
        progress: &dyn Progress,
    ) -> Result<T> {
        let Some((folder, identity)) = &self.place else {
            return make();
        };
        let mut sum = Sha256::new();
        let of = to_bytes(of)?;
        for part in [FORMAT.as_bytes(), identity.as_bytes(), name.as_bytes(), &of] {
            sum.update(Sha256::digest(part));
        }
        let of = hex(&sum.finalize());
        let path = folder.join(format!("{name}-{}", &of[..16]));
        if let Some(bytes) = std::fs::read(&path).ok().filter(|_| self.resume) {
            if let Some(value) = unsealed(&format!("{FORMAT} {of}"), &bytes) {
                return Ok(value);
            }
            let damaged = format!("{} is damaged: this stage is done again", path.display());
            progress.begin(&damaged, None);
            progress.end();
        }
        let value = make()?;
        make_folder(folder)?;
        replace(&path, sealed(&format!("{FORMAT} {of}"), &value)?)?;
        Ok(value)
    }
}

/// The bytes of a file that holds a value: a line of its format and of the digest of what follows, then the value.
///
/// # Errors
/// Of the program: a value that has no bytes.
pub fn sealed(format: &str, value: &impl Serialize) -> Result<Vec<u8>> {
    let mut content = to_bytes(value)?;
    let sum = hex(&Sha256::digest(&content));
    let mut bytes = format!("{format} {sum}\n").into_bytes();
    bytes.append(&mut content);
    Ok(bytes)
}

/// What such a file holds, if it is of this format and not damaged.
pub fn unsealed<T: DeserializeOwned>(format: &str, bytes: &[u8]) -> Option<T> {
    let end = bytes.iter().position(|b| *b == b'\n')?;
    let content = &bytes[end + 1..];
    let sum = hex(&Sha256::digest(content));
    if bytes[..end] != *format!("{format} {sum}").as_bytes() {
        return None;
    }
    rmp_serde::from_slice(content).ok()
}

/// A value as MessagePack with the names of fields, which some types leave out: numbers to the last bit, infinities and NaN too.
///
/// # Errors
/// Of the program: a value that has none.
pub fn to_bytes(value: &impl Serialize) -> Result<Vec<u8>> {
    rmp_serde::to_vec_named(value)
        .map_err(|e| Error::program("stage", "a value with bytes").found(e))
}
