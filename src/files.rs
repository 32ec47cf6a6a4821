//! Files written in one step.

use std::path::Path;

use crate::error::{Error, Result};

/// Write a file beside its place and move it there, so that neither a kill nor a reader at the same time finds half of it.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn replace(path: &Path, contents: impl AsRef<[u8]>) -> Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    std::fs::write(&beside, contents)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|e| Error::input(path.display(), "a file that can be written").found(e))
}
