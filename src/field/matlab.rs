//! Arrays of a MATLAB file as the text of a table: one column an array, or a column of one, one row an element.
//!
//! Files of MATLAB 5 to 7 are the crate's; MATLAB 4, which VIC-2D writes, is a header of five integers before each array.

use std::fmt::Write;
use std::path::Path;

use matfile::{MatFile, NumericData};

use crate::error::{Error, Result};

/// A named array, by columns.
struct NamedArray {
    name: String,
    rows: usize,
    values: Vec<f64>,
}

/// The text, or none if the bytes are no MATLAB file.
///
/// # Errors
/// Of the input: a MATLAB file that is broken, or has no arrays of one size.
pub(super) fn as_text(path: &Path, bytes: &[u8]) -> Result<Option<String>> {
    let wrong = |found: &str| {
        let error = Error::input(path.display(), "a MATLAB file with arrays of numbers");
        error.found(found).hint(STRUCTS)
    };
    let arrays = if bytes.starts_with(b"MATLAB 5.0") {
        let file = MatFile::parse(bytes).map_err(|e| wrong(&e.to_string()))?;
        file.arrays().iter().filter_map(of_version_5).collect()
    } else {
        match of_version_4(bytes) {
            Some(arrays) => arrays,
            None => return Ok(None),
        }
    };
    let columns: Vec<(String, Vec<f64>)> = columns(arrays);
    let longest = columns.iter().map(|(_, v)| v.len());
    let mut counts: Vec<usize> = longest.collect();
    counts.sort_unstable();
    // the points are what most of the columns have
    let most = counts
        .chunk_by(|a, b| a == b)
        .max_by_key(|c| (c.len(), c[0]));
    let rows = most.map_or(0, |c| c[0]);
    let columns: Vec<_> = columns
        .into_iter()
        .filter(|(_, v)| v.len() == rows)
        .collect();
    if columns.len() < 4 || rows < 2 {
        return Err(too_few(path, &columns));
    }
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = names.join(",") + "\n";
    if names.contains(&"U") && !names.contains(&"sigma") {
        // somebody's own arrays and not VIC-3D's: a row of units that are not known
        text += &(vec!["unknown"; names.len()].join(",") + "\n");
    }
    for row in 0..rows {
        for (k, (_, values)) in columns.iter().enumerate() {
            // writing to a String cannot fail
            let _ = write!(text, "{}{}", if k > 0 { "," } else { "" }, values[row]);
        }
        text.push('\n');
    }
    Ok(Some(text))
}

const STRUCTS: &str = "structs are not read: in MATLAB save('field.mat', 'x', 'y', 'u', 'v', '-v7') with one array each; of Ncorr u = data_dic_save.displacements(1).plot_u_ref_formatted, v likewise";

/// There are not both places and displacements.
fn too_few(path: &Path, columns: &[(String, Vec<f64>)]) -> Error {
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let error = Error::input(path.display(), "four arrays of one size, x, y, u and v");
    if names.is_empty() {
        return error.found("no array of numbers").hint(STRUCTS);
    }
    let hint = "the others are missing, or of another size. If the places x and y are: in MATLAB [x, y] = meshgrid(first:step:last, first:step:last), the centres of the subsets in pixels, of the size of u; then save('field.mat', 'x', 'y', 'u', 'v', '-v7'). Structs are not read";
    error.found(names.join(", ")).hint(hint)
}

/// Arrays of few columns are split: places and displacements stand side by side in them.
fn columns(arrays: Vec<NamedArray>) -> Vec<(String, Vec<f64>)> {
    const FEW: usize = 8;
    let mut columns = Vec::new();
    for NamedArray { name, rows, values } in arrays {
        let count = values.len().checked_div(rows).unwrap_or(0);
        if (2..=FEW).contains(&count) && rows > 4 * FEW {
            let parts = values.chunks(rows).enumerate();
            columns.extend(parts.map(|(k, part)| (format!("{name}_{}", k + 1), part.to_vec())));
        } else {
            columns.push((name, values));
        }
    }
    columns
}

fn of_version_5(array: &matfile::Array) -> Option<NamedArray> {
    fn all<T: Copy>(values: &[T], to: impl Fn(T) -> f64) -> Vec<f64> {
        values.iter().map(|v| to(*v)).collect()
    }
    let values = match array.data() {
        NumericData::Int8 { real, .. } => all(real, f64::from),
        NumericData::UInt8 { real, .. } => all(real, f64::from),
        NumericData::Int16 { real, .. } => all(real, f64::from),
        NumericData::UInt16 { real, .. } => all(real, f64::from),
        NumericData::Int32 { real, .. } => all(real, f64::from),
        NumericData::UInt32 { real, .. } => all(real, f64::from),
        NumericData::Int64 { real, .. } => all(real, |v| v as f64),
        NumericData::UInt64 { real, .. } => all(real, |v| v as f64),
        NumericData::Single { real, .. } => all(real, f64::from),
        NumericData::Double { real, .. } => real.clone(),
    };
    Some(NamedArray {
        name: array.name().to_string(),
        rows: *array.size().first()?,
        values,
    })
}

/// Little-endian arrays of full matrices; none where the bytes are something else.
fn of_version_4(bytes: &[u8]) -> Option<Vec<NamedArray>> {
    const LONGEST_NAME: usize = 64;
    let mut rest = bytes;
    let mut arrays = Vec::new();
    while !rest.is_empty() {
        let (head, after) = rest.split_at_checked(20)?;
        let integer = |k: usize| {
            let four = head.get(4 * k..4 * k + 4)?.try_into().ok()?;
            usize::try_from(i32::from_le_bytes(four)).ok()
        };
        let [kind, rows, columns, imaginary, length] = [
            integer(0)?,
            integer(1)?,
            integer(2)?,
            integer(3)?,
            integer(4)?,
        ];
        let size = *[8, 4, 4, 2, 2, 1].get(kind / 10)?;
        if kind % 10 != 0 || imaginary > 1 || !(2..=LONGEST_NAME).contains(&length) {
            return None;
        }
        let (name, after) = after.split_at_checked(length)?;
        let count = rows.checked_mul(columns)?;
        let total = count.checked_mul(size)?.checked_mul(1 + imaginary)?;
        let (data, after) = after.split_at_checked(total)?;
        let name = std::str::from_utf8(name).ok()?.trim_end_matches('\0');
        let values: Vec<f64> = data[..count * size]
            .chunks(size)
            .filter_map(|b| little(kind / 10, b))
            .collect();
        arrays.push(NamedArray {
            name: name.to_string(),
            rows,
            values,
        });
        rest = after;
    }
    (!arrays.is_empty()).then_some(arrays)
}

/// A number of one of the kinds of MATLAB 4.
fn little(kind: usize, bytes: &[u8]) -> Option<f64> {
    Some(match kind {
        0 => f64::from_le_bytes(bytes.try_into().ok()?),
        1 => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
        2 => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
        3 => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)),
        4 => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)),
        _ => f64::from(*bytes.first()?),
    })
}
