//! The bytes of a mesh file.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{in_place_of, plain};

/// The bytes of a file, text of it in UTF-8 without a byte order mark.
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
    let bytes = std::fs::read(path)
        .map_err(|e| Error::input(path.display(), "a file that can be read").found(e))?;
    if let Some((found, hint)) = in_place_of(&bytes) {
        let error = Error::input(path.display(), "a mesh");
        return Err(error.found(found).hint(hint));
    }
    Ok(plain(bytes))
}
