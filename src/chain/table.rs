//! A table of named rows and columns of numbers as Zarr, beside the chains: xarray opens it as a dataset of arrays along `run`.

use std::path::Path;

use serde_json::json;

use super::zarr::{self, ArrayKind};
use crate::error::{Error, Result};

/// Write columns of numbers, each an array along `run`; NaN where there is none. The rows' names are the attribute `runs`, as this
/// store has numbers only. A table that was there is replaced.
///
/// # Errors
/// The input's fault if the place cannot be written.
pub fn write_table(path: &Path, rows: &[&str], columns: &[(String, Vec<f64>)]) -> Result<()> {
    if path.exists() {
        std::fs::remove_dir_all(path)
            .map_err(|e| Error::input(path.display(), "a writable folder").found(e))?;
    }
    let mut below = Vec::new();
    for (name, numbers) in columns {
        let shape = [numbers.len()];
        let metadata = zarr::array(ArrayKind::Float, &shape, &shape, &["run"]);
        zarr::replace(&path.join(name).join("c/0"), &zarr::floats(numbers))?;
        zarr::replace_metadata(&path.join(name), &metadata)?;
        below.push((name.clone(), metadata));
    }
    let root = zarr::group(&json!({ "runs": rows }));
    zarr::replace_metadata(path, &zarr::consolidated(&root, &below))
}
