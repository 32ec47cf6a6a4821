//! What the parts of a report have in common as JSON.

use std::path::Path;

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::error::{Error, Result};

pub use crate::files::{Keyed, or_nan};
use crate::files::{parse_json, parse_part};

/// Name and text of a file in the folder of a finished run.
///
/// # Errors
/// The input's fault, with the file, if it cannot be read.
pub fn read(folder: &Path, name: &str) -> Result<(String, String)> {
    let file = folder.join(name).display().to_string();
    let text = std::fs::read_to_string(&file).map_err(|e| {
        Error::input(&file, "a file of a finished run")
            .found(e)
            .hint("give the folder of a run, for example runs/openhole")
    })?;
    Ok((file, text))
}

/// What a JSON file in the folder of a finished run holds.
///
/// # Errors
/// The input's fault, with the file and the key, if it cannot be read.
pub fn load<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<T> {
    let (file, text) = read(folder, name)?;
    parse_json(&text, &file)
}

/// What every file says of its version.
#[derive(Deserialize)]
pub struct Versioned {
    pub schema: String,
}

/// What the remaining keys of an object hold, if `key` is one of them. (An optional flattened part would swallow its
/// errors.)
pub(super) fn part<'de, D: Deserializer<'de>, T: DeserializeOwned>(
    rest: D,
    key: &str,
) -> std::result::Result<Option<T>, D::Error> {
    let rest = Map::<String, Value>::deserialize(rest)?;
    if !rest.contains_key(key) {
        return Ok(None);
    }
    let read = parse_part(&Value::Object(rest).to_string());
    read.map(Some).map_err(D::Error::custom)
}

/// What stands for a number that an earlier version did not write.
pub(super) fn nan() -> f64 {
    f64::NAN
}

/// A number for JSON, which has neither infinity nor NaN.
pub(super) fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}
