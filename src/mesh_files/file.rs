//! The bytes of a mesh file.

use std::path::Path;

use crate::error::{Error, Result};

/// The bytes of a file.
pub fn load(path: &Path) -> Result<Vec<u8>> {
    // a device or a pipe may never end
    let regular = std::fs::metadata(path).map(|m| m.is_file());
    match regular {
        Ok(true) => {}
        Ok(false) => {
            return Err(
                Error::input(path.display(), "a file").found("a folder, or what is no file")
            );
        }
        Err(e) => return Err(Error::input(path.display(), "a file that can be read").found(e)),
    }
    std::fs::read(path)
        .map_err(|e| Error::input(path.display(), "a file that can be read").found(e))
}
