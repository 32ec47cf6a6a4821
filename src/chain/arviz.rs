//! Groups of draws as ArviZ, PyMC and nuts-rs write them in Zarr (versions 2 and 3): `posterior`, with an array of chain x draw x ... for each
//! variable, and `sample_stats`, with the log density and what the sampler says of its transitions.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::codecs::{Filters, NumberKind};
use super::columns::{ColumnRole, statistics};
use super::draws::Draws;
use super::zarr::FORMAT;
use crate::error::{Error, Result};

/// Whether a folder holds groups of this kind, of another program than this.
pub fn is_groups(path: &Path) -> bool {
    let posterior = path.join("posterior");
    let root = std::fs::read_to_string(path.join("zarr.json")).unwrap_or_default();
    let has_group = [".zgroup", "zarr.json"]
        .iter()
        .any(|f| posterior.join(f).is_file());
    has_group && !root.contains(FORMAT)
}

/// Reads the draws of a store; an element of an array is a parameter of its own, `name[0,1]`. Draws of the warm-up are left out.
///
/// # Errors
/// The input's fault, with the path: no such groups, an array that cannot be read, arrays of different chains.
pub fn read_groups(path: &Path) -> Result<Draws> {
    let group = path.join("posterior");
    let mut variables = Vec::new();
    let entries = std::fs::read_dir(&group)
        .map_err(|e| Error::input(group.display(), "a group of draws").found(e))?;
    let mut folders: Vec<_> = entries.flatten().map(|e| e.path()).collect();
    folders.sort();
    for folder in &folders {
        let Some(array) = GroupArray::open(folder)? else {
            continue;
        };
        if array.is_drawn() {
            variables.push(array);
        } else if ["chain", "draw"].iter().all(|d| array.has(d)) {
            let found = format!("{} ({:?})", array.dimensions.join(" x "), array.shape);
            return Err(
                Error::input(folder.display(), "chain x draw x ..., none of 0")
                    .found(found)
                    .hint("transpose('chain', 'draw', ...)"),
            );
        }
    }
    let Some(first) = variables.first() else {
        return Err(Error::input(group.display(), "arrays of chain x draw").found("none"));
    };
    let [chains, draws] = [first.shape[0], first.shape[1]];
    let (mut names, mut columns) = (Vec::new(), Vec::new());
    for array in &variables {
        if array.shape[..2] != [chains, draws] {
            let expected = format!("{chains} chains x {draws} draws, as {} has", first.name);
            return Err(Error::input(&array.name, expected).found(format!("{:?}", array.shape)));
        }
        let elements: usize = array.shape[2..].iter().product();
        let values = array.read()?;
        for element in 0..elements {
            names.push(element_name(&array.name, &array.shape[2..], element));
            columns.push(
                values
                    .iter()
                    .copied()
                    .skip(element)
                    .step_by(elements)
                    .collect::<Vec<f64>>(),
            );
        }
    }
    let count = chains * draws;
    let point = |at: usize| columns.iter().map(move |column| column[at]);
    let values = (0..count).flat_map(point).collect();
    let statistic = |role| statistic(path, statistics(role), [chains, draws]);
    let lp = statistic(ColumnRole::LogDensity)?.unwrap_or_else(|| vec![f64::NAN; count]);
    let mut read = Draws::new(names, (0..chains).collect(), values, lp)?;
    for role in [
        ColumnRole::Divergent,
        ColumnRole::TreeDepth,
        ColumnRole::Saturated,
        ColumnRole::Energy,
    ] {
        let found = role.name().zip(statistic(role)?);
        read.info
            .columns
            .extend(found.map(|(name, values)| (name.into(), values)));
    }
    if path.join("warmup_posterior").is_dir() {
        let remark = "the draws of the warm-up (warmup_posterior) are left out";
        read.info.remarks.push(remark.into());
    }
    Ok(read)
}

/// The first array of `sample_stats` with one of these names.
fn statistic(path: &Path, names: &[&str], shape: [usize; 2]) -> Result<Option<Vec<f64>>> {
    for name in names {
        let array = GroupArray::open(&path.join("sample_stats").join(name))?;
        if let Some(array) = array.filter(|a| a.shape == shape) {
            return array.read().map(Some);
        }
    }
    Ok(None)
}

/// `name[1,0]` for an element of the last axes; the name alone where there are none.
pub(super) fn element_name(name: &str, shape: &[usize], element: usize) -> String {
    let mut rest = element;
    let mut places: Vec<String> = Vec::new();
    for side in shape.iter().rev() {
        places.push((rest % side).to_string());
        rest /= side;
    }
    places.reverse();
    match places.is_empty() {
        true => name.to_string(),
        false => format!("{name}[{}]", places.join(",")),
    }
}

/// An array of a group.
struct GroupArray {
    folder: PathBuf,
    name: String,
    shape: Vec<usize>,
    chunks: Vec<usize>,
    dimensions: Vec<String>,
    kind: NumberKind,
    filters: Filters,
    fill: f64,
    /// Factor and offset of packed numbers, and the one that stands for none (conventions CF, as xarray writes them).
    packed: [f64; 3],
    /// What stands before and between the numbers of a chunk's name.
    key: (&'static str, String),
}

impl GroupArray {
    /// The array in a folder; none if there is no array of numbers.
    fn open(folder: &Path) -> Result<Option<Self>> {
        let name = folder
            .file_name()
            .and_then(|n| n.to_str())
            .unwrap_or_default();
        let json = |file: &str| -> Result<Option<Value>> {
            let path = folder.join(file);
            let Ok(text) = std::fs::read(&path) else {
                return Ok(None);
            };
            // Python writes NaN as a number
            let text = String::from_utf8_lossy(&text).replace("NaN", "null");
            let value = serde_json::from_str(&text);
            value
                .map(Some)
                .map_err(|e| Error::input(path.display(), "valid JSON").found(e))
        };
        let sides = |value: &Value| -> Vec<usize> {
            let all = value.as_array().into_iter().flatten();
            all.filter_map(|v| v.as_u64().map(|v| v as usize)).collect()
        };
        let texts = |value: &Value| -> Vec<String> {
            let all = value.as_array().into_iter().flatten();
            all.filter_map(|v| v.as_str().map(String::from)).collect()
        };
        let whole = json("zarr.json")?.filter(|m| m["node_type"] == "array");
        let old = match whole {
            None => json(".zarray")?,
            Some(_) => None,
        };
        let old_attributes = json(".zattrs")?.unwrap_or_default();
        let Some((meta, is_old)) = whole.map(|m| (m, false)).or(old.map(|m| (m, true))) else {
            return Ok(None);
        };
        let (kind, filters) = match is_old {
            true => (NumberKind::of_old(&meta["dtype"]), Filters::of_old(&meta)),
            false => (
                NumberKind::of(&meta["data_type"]),
                Filters::of(&meta["codecs"]),
            ),
        };
        let Some(kind) = kind else { return Ok(None) };
        let filters = filters.map_err(|found| {
            Error::input(
                folder.display(),
                "raw numbers, or gzip, zlib, zstd or Blosc of lz4, zlib or zstd",
            )
            .found(found)
        })?;
        let separator = |value: &Value, usual: &str| value.as_str().unwrap_or(usual).to_string();
        let encoding = &meta["chunk_key_encoding"];
        let of_version_2 = encoding["name"] == "v2";
        Ok(Some(Self {
            folder: folder.to_path_buf(),
            name: name.to_string(),
            shape: sides(&meta["shape"]),
            chunks: match is_old {
                true => sides(&meta["chunks"]),
                false => sides(&meta["chunk_grid"]["configuration"]["chunk_shape"]),
            },
            dimensions: match is_old {
                true => texts(&old_attributes["_ARRAY_DIMENSIONS"]),
                false => texts(&meta["dimension_names"]),
            },
            kind,
            filters,
            fill: meta["fill_value"].as_f64().unwrap_or(f64::NAN),
            packed: packed(match is_old {
                true => &old_attributes,
                false => &meta["attributes"],
            }),
            key: match (is_old, of_version_2) {
                (true, _) => ("", separator(&meta["dimension_separator"], ".")),
                (_, true) => ("", separator(&encoding["configuration"]["separator"], ".")),
                _ => ("c", separator(&encoding["configuration"]["separator"], "/")),
            },
        }))
    }

    fn has(&self, dimension: &str) -> bool {
        self.dimensions.iter().any(|own| own == dimension)
    }

    fn is_drawn(&self) -> bool {
        let named = self.dimensions.len() >= 2 && self.dimensions[..2] == ["chain", "draw"];
        named && self.shape.len() == self.chunks.len() && self.shape.iter().all(|n| *n > 0)
    }

    /// All numbers, the last axis fastest.
    fn read(&self) -> Result<Vec<f64>> {
        let mut values = vec![self.fill; self.shape.iter().product()];
        let grid: Vec<usize> = self
            .shape
            .iter()
            .zip(&self.chunks)
            .map(|(n, c)| n.div_ceil(*c))
            .collect();
        for index in 0..grid.iter().product::<usize>() {
            let chunk = places(index, &grid);
            let numbers: Vec<String> = chunk.iter().map(ToString::to_string).collect();
            let (first, between) = &self.key;
            let parts = [*first].into_iter().filter(|f| !f.is_empty());
            let parts: Vec<&str> = parts.chain(numbers.iter().map(String::as_str)).collect();
            let path = self.folder.join(parts.join(between));
            // a chunk that was never written is the fill value
            let Ok(bytes) = std::fs::read(&path) else {
                continue;
            };
            let count: usize = self.chunks.iter().product();
            let own = self
                .filters
                .decode(bytes, (self.kind, count))
                .map_err(|found| {
                    Error::input(path.display(), format!("a chunk of {count} numbers")).found(found)
                })?;
            self.place(&chunk, &own, &mut values);
        }
        let [factor, offset, none] = self.packed;
        let unpacked = |v: f64| {
            if v == none {
                f64::NAN
            } else {
                v * factor + offset
            }
        };
        Ok(values.into_iter().map(unpacked).collect())
    }

    /// Put the numbers of a chunk where they belong.
    fn place(&self, chunk: &[usize], own: &[f64], values: &mut [f64]) {
        for (k, value) in own.iter().enumerate() {
            let inside = places(k, &self.chunks);
            let at = inside
                .iter()
                .zip(chunk)
                .zip(&self.chunks)
                .map(|((i, c), side)| c * side + i);
            let at: Vec<usize> = at.collect();
            if at.iter().zip(&self.shape).all(|(i, n)| i < n) {
                let place = at
                    .iter()
                    .zip(&self.shape)
                    .fold(0, |sum, (i, n)| sum * n + i);
                values[place] = *value;
            }
        }
    }
}

fn packed(attributes: &Value) -> [f64; 3] {
    let usual = [
        ("scale_factor", 1.0),
        ("add_offset", 0.0),
        ("_FillValue", f64::NAN),
    ];
    usual.map(|(name, usual)| attributes[name].as_f64().unwrap_or(usual))
}

/// The place along each axis of the element number `index`, the last axis fastest.
fn places(mut index: usize, shape: &[usize]) -> Vec<usize> {
    let mut places = vec![0; shape.len()];
    for (place, side) in places.iter_mut().zip(shape).rev() {
        *place = index % side;
        index /= side;
    }
    places
}
