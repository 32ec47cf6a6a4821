//! The little of Zarr v3 that a chain store needs: groups and arrays as `zarr.json`, chunks as little-endian files, raw or gzip.
//! Every file is written beside its place and renamed into it, so that a reader or a kill never meets half a file.

use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files;

/// Version of the store's own conventions.
pub(super) const FORMAT: &str = "plychain-chain/1";

/// Floats of a chunk, about 1 MiB.
pub(super) const CHUNK: usize = 1 << 17;

/// Most floats of a chunk, of so many chains.
pub(super) fn most_of_a_chunk(chains: usize) -> usize {
    CHUNK.max(chains).saturating_mul(2)
}

/// The arrays of draws of some parameters: theirs, and last that of the log density.
pub(super) fn arrays(names: &[String]) -> impl Iterator<Item = String> {
    let names = names.iter().map(|n| format!("posterior/{n}"));
    names.chain(["sample_stats/lp".to_string()])
}

/// Type of an array's elements.
#[derive(Debug, Clone, Copy)]
pub(super) enum ArrayKind {
    Float,
    Integer,
}

/// The level of gzip by which chunks are packed: a higher one takes three times as long and saves 3 % of chains.
const LEVEL: u32 = 1;

/// The bytes of a chunk's file.
pub(super) fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(LEVEL));
    // writing to a vector cannot fail
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// A chunk of `count` floats from the bytes of its file.
fn unpacked(bytes: &[u8], count: usize) -> std::io::Result<Vec<f64>> {
    let size = count.saturating_mul(8);
    let mut whole = Vec::new();
    let mut decoder = GzDecoder::new(bytes).take((size as u64).saturating_add(1));
    decoder.read_to_end(&mut whole)?;
    if whole.len() != size {
        let found = format!("{} bytes", whole.len());
        return Err(std::io::Error::other(found));
    }
    let (words, _) = whole.as_chunks::<8>();
    Ok(words.iter().map(|w| f64::from_le_bytes(*w)).collect())
}

/// Metadata of a group.
pub(super) fn group(attributes: &Value) -> Value {
    json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes })
}

/// Metadata of an array of named dimensions.
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
        "codecs": [
            { "name": "bytes", "configuration": { "endian": "little" } },
            { "name": "gzip", "configuration": { "level": LEVEL } },
        ],
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
        files::make_folder(parent)?;
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
    unpacked(&bytes, count).map_err(|e| {
        Error::input(path.display(), format!("{count} numbers of 8 bytes"))
            .found(e)
            .hint("the chain store is damaged")
    })
}

/// Bytes of floats.
pub(super) fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of integers.
pub(super) fn integers(values: impl Iterator<Item = i64>) -> Vec<u8> {
    values.flat_map(i64::to_le_bytes).collect()
}
