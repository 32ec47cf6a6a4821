//! The little of Zarr v3 that a chain store needs: groups and arrays as `zarr.json`, chunks as raw little-endian files.
//! Every file is written beside its place and renamed into it, so that a reader or a kill never meets half a file.

use std::path::Path;

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files;

/// Version of the store's own conventions.
pub(super) const FORMAT: &str = "plychain-chain/1";

/// Type of an array's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ArrayKind {
    Float,
    Integer,
}

/// Metadata of a group.
pub(super) fn group(attributes: &Value) -> Value {
    json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes })
}

/// Metadata of an array of named dimensions, uncompressed.
pub(super) fn array(
    kind: ArrayKind,
    shape: &[usize],
    chunk: &[usize],
    dimensions: &[&str],
) -> Value {
    let (data_type, fill) = match kind {
        ArrayKind::Float => ("float64", json!("NaN")),
        ArrayKind::Integer => ("int64", json!(0)),
    };
    json!({
        "zarr_format": 3, "node_type": "array",
        "shape": shape, "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": fill,
        "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
        "attributes": {}, "dimension_names": dimensions,
    })
}

/// The same group with the metadata of everything below it, by path.
pub(super) fn consolidated(root: &Value, below: &[(String, Value)]) -> Value {
    let metadata: serde_json::Map<_, _> = below.iter().cloned().collect();
    let mut root = root.clone();
    root["consolidated_metadata"] =
        json!({ "kind": "inline", "must_understand": false, "metadata": metadata });
    root
}

/// Replaces a file in one step, in a folder that is made if need be.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent)
            .map_err(|e| Error::input(parent.display(), "a writable folder").found(e))?;
    }
    files::replace(path, bytes)
}

/// Replaces the `zarr.json` of a node.
pub(super) fn replace_metadata(node: &Path, value: &Value) -> Result<()> {
    let text = serde_json::to_vec_pretty(value)
        .map_err(|e| Error::program("zarr.json", "numbers that JSON can hold").found(e))?;
    replace(&node.join("zarr.json"), &text)
}

/// Reads the `zarr.json` of a node.
pub(super) fn read_metadata(node: &Path) -> Result<Value> {
    let path = node.join("zarr.json");
    let text = std::fs::read(&path).map_err(|e| {
        Error::input(path.display(), "the metadata of a Zarr v3 group or array").found(e)
    })?;
    serde_json::from_slice(&text).map_err(|e| Error::input(path.display(), "valid JSON").found(e))
}

/// Reads a chunk of `count` floats.
pub(super) fn read_chunk(path: &Path, count: usize) -> Result<Vec<f64>> {
    let bytes = std::fs::read(path)
        .map_err(|e| Error::input(path.display(), "a chunk of the chain store").found(e))?;
    if bytes.len() != 8 * count {
        return Err(Error::input(path.display(), format!("{} bytes", 8 * count)).found(bytes.len()));
    }
    let (words, _) = bytes.as_chunks::<8>();
    Ok(words.iter().map(|w| f64::from_le_bytes(*w)).collect())
}

/// Bytes of floats.
pub(super) fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of integers.
pub(super) fn integers(values: impl Iterator<Item = i64>) -> Vec<u8> {
    values.flat_map(i64::to_le_bytes).collect()
}
