//! A table of named rows and columns of numbers as Zarr, beside the chains: xarray opens it as a dataset of arrays along `run`.

use std::path::Path;

use serde_json::json;

use super::zarr::{self, ArrayKind, Codec};
use crate::error::Result;
use crate::files::replace_folder;

/// Write columns of numbers, each an array along `run`; NaN where there is none. The rows' names are the attribute `runs`, as this
/// store has numbers only. A table that was there is replaced.
///
/// # Errors
/// The input's fault if the place cannot be written.
pub fn write_table(path: &Path, rows: &[&str], columns: &[(String, Vec<f64>)]) -> Result<()> {
    replace_folder(path, |path| write_new(path, rows, columns))
}

fn write_new(path: &Path, rows: &[&str], columns: &[(String, Vec<f64>)]) -> Result<()> {
    let mut below = Vec::new();
    for (name, numbers) in columns {
        let shape = [numbers.len()];
        let metadata = zarr::array((ArrayKind::Float, Codec::Raw), &shape, &shape, &["run"]);
        zarr::replace(&path.join(name).join("c/0"), &zarr::floats(numbers))?;
        zarr::replace_metadata(&path.join(name), &metadata)?;
        below.push((name.clone(), metadata));
    }
    let root = zarr::group(&json!({ "runs": rows }));
    zarr::replace_metadata(path, &zarr::consolidated(&root, &below))
}
