//! Chain stores that say more than they hold, or hold other draws than were written: every verb names them, and leaves no half of a file.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use plychain::chain::{Draws, read_zarr, write_zarr};
use serde_json::{Value, json};

use crate::common::{fresh, plychain_in};

/// A run's folder with a store of four chains of two parameters.
fn store() -> PathBuf {
    let place = fresh("stored");
    std::fs::create_dir_all(&place).unwrap();
    let (chains, count) = (4, 300);
    let values = (0..chains * count * 2).map(|k| (f64::from(k) * 0.7).sin());
    let names = vec!["E1_GPa".to_string(), "E2_GPa".to_string()];
    let lp = (0..chains * count)
        .map(|k| -(f64::from(k) * 0.3).cos())
        .collect();
    let ensembles = (0..chains as usize).collect();
    let draws = Draws::new(names, ensembles, values.collect(), lp).unwrap();
    write_zarr(&draws, &place.join("chain.zarr")).unwrap();
    assert_eq!(
        read_zarr(&place.join("chain.zarr"), None).unwrap().values(),
        draws.values()
    );
    place
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut all: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    all.sort();
    all
}

/// Every verb that reads draws refuses a store that was changed, names what is wrong, and leaves no file behind.
fn refused(change: &dyn Fn(&Path), words: &[&str]) {
    let place = store();
    change(&place.join("chain.zarr"));
    let before = files(&place);
    let verbs: [&[&str]; 5] = [
        &["diagnose", "."],
        &["export", ".", "--format", "csv"],
        &["export", ".", "--format", "npz"],
        &["export", ".", "--format", "stan-csv"],
        &["export", ".", "--format", "getdist"],
    ];
    for verb in verbs {
        let end = plychain_in(&place, verb);
        let said = String::from_utf8_lossy(&end.stderr).into_owned();
        assert_eq!(end.status.code(), Some(1), "{verb:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{verb:?}: {said}\n{word}");
        }
        assert_eq!(files(&place), before, "{verb:?}");
    }
    assert!(plychain_in(&place, &["report", "."]).status.code() == Some(1));
}

fn unpacked(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    let packed = std::fs::read(path).unwrap();
    GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    bytes
}

fn pack(path: &Path, bytes: &[u8]) {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    std::fs::write(path, encoder.finish().unwrap()).unwrap();
}

fn edit(store: &Path, change: &dyn Fn(&mut Value)) {
    let path = store.join("zarr.json");
    let mut root: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    change(&mut root);
    std::fs::write(&path, root.to_string()).unwrap();
}

const CHUNK: &str = "posterior/E1_GPa/c/0/0";

#[test]
fn one_draw_that_was_changed_is_named() {
    let change = |store: &Path| {
        let mut bytes = unpacked(&store.join(CHUNK));
        bytes[80..88].copy_from_slice(&1e6_f64.to_le_bytes());
        pack(&store.join(CHUNK), &bytes);
    };
    refused(
        &change,
        &["posterior/E1_GPa", "the draws that were written"],
    );
}

#[test]
fn arrays_that_were_exchanged_are_named() {
    let change = |store: &Path| {
        std::fs::copy(store.join("posterior/E2_GPa/c/0/0"), store.join(CHUNK)).unwrap();
    };
    refused(&change, &["posterior/E1_GPa"]);
}

#[test]
fn a_chunk_of_another_size_is_named() {
    for keep in [0, 8, 4000] {
        let change = move |store: &Path| {
            let bytes = unpacked(&store.join(CHUNK));
            pack(&store.join(CHUNK), &bytes[..keep]);
        };
        refused(&change, &[CHUNK, "numbers of 8 bytes"]);
    }
    let longer = |store: &Path| {
        let mut bytes = unpacked(&store.join(CHUNK));
        bytes.extend([0; 64]);
        pack(&store.join(CHUNK), &bytes);
    };
    refused(&longer, &[CHUNK, "numbers of 8 bytes"]);
}

/// Shapes of all arrays, and their chunks.
fn reshaped(root: &mut Value, shape: &Value, chunk: &Value) {
    let metadata = root["consolidated_metadata"]["metadata"].as_object_mut();
    for (name, array) in metadata.unwrap() {
        if name.ends_with("_GPa") || name.ends_with("/lp") {
            array["shape"] = shape.clone();
            array["chunk_grid"]["configuration"]["chunk_shape"] = chunk.clone();
        }
    }
}

#[test]
fn shapes_beyond_what_is_stored_are_named() {
    for (shape, chunk, word) in [
        (
            json!([4, 1_000_000_000_000_u64]),
            json!([4, 300]),
            "the last chunk of the array",
        ),
        (
            json!([4, 301]),
            json!([4, 300]),
            "the last chunk of the array",
        ),
        (
            json!([4, 1_000_000_000_000_u64]),
            json!([4, 1_000_000_000_000_u64]),
            "chunks of about 1 MiB",
        ),
        (json!([256, 300]), json!([256, 300]), "numbers of 8 bytes"),
        (json!([u64::MAX, 300]), json!([u64::MAX, 300]), ""),
        (json!([4, 300]), json!([4, 150]), ""),
        (
            json!([4, 200]),
            json!([4, 300]),
            "the draws that were written",
        ),
    ] {
        refused(
            &|store| edit(store, &|root| reshaped(root, &shape, &chunk)),
            &[word],
        );
    }
    // one array unlike the others
    let odd = |root: &mut Value| {
        let array = &mut root["consolidated_metadata"]["metadata"]["posterior/E1_GPa"];
        array["shape"] = json!([4, 299]);
    };
    refused(&|store| edit(store, &odd), &["posterior/E1_GPa", "[4,299]"]);
}

#[test]
fn digests_that_were_taken_out_are_missed() {
    let part = |root: &mut Value| {
        root["attributes"]["digests"]
            .as_object_mut()
            .unwrap()
            .remove("sample_stats/lp");
    };
    refused(&|store| edit(store, &part), &["digests"]);
}
