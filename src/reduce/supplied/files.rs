//! The field of one row: a table, NumPy's archive or VTK's unstructured grid, of displacements at nodes or other points.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, Trim};

use super::nodes::Nodes;
use super::vtu;
use crate::chain::read_npy;
use crate::error::{Error, Result};

/// Columns of a table and arrays of an archive.
const NAMES: [&str; 4] = ["x_mm", "y_mm", "ux_mm", "uy_mm"];

/// The files that a pattern with one `*` in its last part names, by the number that stands there.
pub(super) fn of_rows(pattern: &Path) -> Result<BTreeMap<u64, PathBuf>> {
    let wanted = |expected: &str| {
        Error::input(
            format!("reduced_model.snapshots.fields: {}", pattern.display()),
            expected.to_string(),
        )
    };
    let name = pattern
        .file_name()
        .map(|n| n.to_string_lossy().into_owned());
    let name = name.unwrap_or_default();
    let (before, after) = name
        .split_once('*')
        .filter(|(_, after)| !after.contains('*'))
        .ok_or_else(|| {
            wanted("one * in the file's name, for the number of the row").hint("fields/*.csv")
        })?;
    let folder = pattern.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).map_err(|e| wanted("a folder of fields").found(e))?;
    let mut found = BTreeMap::new();
    for entry in entries.flatten() {
        let own = entry.file_name().to_string_lossy().into_owned();
        let middle = own.strip_prefix(before).and_then(|o| o.strip_suffix(after));
        let digits = middle.filter(|m| !m.is_empty() && m.bytes().all(|b| b.is_ascii_digit()));
        let Some(number) = digits.and_then(|m| m.parse().ok()) else {
            continue;
        };
        if let Some(other) = found.insert(number, entry.path()) {
            return Err(wanted("one file a row").found(format!("{} and {own}", other.display())));
        }
    }
    if found.is_empty() {
        return Err(wanted("files whose * is the number of a row").found("none"));
    }
    Ok(found)
}

/// Read one file by its extension.
pub(super) fn read(path: &Path) -> Result<Nodes> {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let nodes = match extension.as_deref().and_then(|e| e.to_str()) {
        Some("csv") => table(path)?,
        Some("npz") => archive(path)?,
        Some("vtu") => vtu::read(path)?,
        _ => {
            return Err(
                Error::input(path.display(), "a field as .csv, .npz or .vtu")
                    .found("another extension"),
            );
        }
    };
    let finite = |p: &[f64; 2]| p.iter().all(|x| x.is_finite());
    let all = nodes.points.iter().zip(&nodes.displacement);
    if let Some(k) = all.clone().position(|(p, u)| !(finite(p) && finite(u))) {
        return Err(
            Error::input(path.display(), "a displacement at every point")
                .found(format!("no number at point {}", k + 1)),
        );
    }
    match all.len() {
        0 => Err(Error::input(path.display(), "points").found("none")),
        _ => Ok(nodes),
    }
}

/// Four columns of any order among others.
fn table(path: &Path) -> Result<Nodes> {
    let wanted = || {
        Error::input(
            path.display(),
            format!("a table with the columns {}", NAMES.join(",")),
        )
    };
    let mut reader = ReaderBuilder::new()
        .trim(Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|e| wanted().found(e))?;
    let headers = reader.headers().map_err(|e| wanted().found(e))?.clone();
    let mut columns = [0; 4];
    for (column, name) in columns.iter_mut().zip(NAMES) {
        let place = headers.iter().position(|h| h == name);
        *column = place.ok_or_else(|| wanted().found(format!("no column {name}")))?;
    }
    let (mut points, mut displacement) = (Vec::new(), Vec::new());
    for (k, record) in reader.records().enumerate() {
        let place = || format!("{}: row {}", path.display(), k + 1);
        let record =
            record.map_err(|e| Error::input(place(), "cells as in the header").found(e))?;
        let mut values = [0.0; 4];
        for (value, &c) in values.iter_mut().zip(&columns) {
            *value = record[c].parse().map_err(|_| {
                Error::input(place(), format!("a number in {}", &headers[c])).found(&record[c])
            })?;
        }
        points.push([values[0], values[1]]);
        displacement.push([values[2], values[3]]);
    }
    Ok(Nodes {
        points,
        displacement,
    })
}

/// Points of a field, at most: a header that promises more is mangled.
const MOST_POINTS: u64 = 50_000_000;

/// Four arrays of an archive of NumPy.
fn archive(path: &Path) -> Result<Nodes> {
    let wanted = || {
        Error::input(
            path.display(),
            format!("an archive of NumPy with the arrays {}", NAMES.join(", ")),
        )
    };
    let bytes = std::fs::read(path).map_err(|e| wanted().found(e))?;
    let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| wanted().found(e))?;
    let mut arrays = Vec::new();
    for name in NAMES {
        let lacks = |e: &dyn std::fmt::Display| wanted().found(format!("{name}: {e}"));
        let mut member = zip.by_name(&format!("{name}.npy")).map_err(|e| lacks(&e))?;
        arrays.push(read_npy(&mut member, MOST_POINTS).map_err(|e| lacks(&e))?);
    }
    if arrays.iter().any(|a| a.len() != arrays[0].len()) {
        let lengths: Vec<String> = arrays.iter().map(|a| a.len().to_string()).collect();
        return Err(wanted().found(format!("arrays of {} numbers", lengths.join(", "))));
    }
    let pair = |a: usize, b: usize| {
        let both = arrays[a].iter().zip(&arrays[b]);
        both.map(|(&x, &y)| [x, y]).collect()
    };
    Ok(Nodes {
        points: pair(0, 1),
        displacement: pair(2, 3),
    })
}
