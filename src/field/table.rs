//! A table with named columns, as programs for digital image correlation export it: comma, semicolon or tab
//! separated, `#` starts a comment line, failed points have empty or NaN cells.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, StringRecord, Trim};

use super::frame::Frame;
use super::grid::Grid;
use super::measured::{FARTHEST_MM, Field, Rejected};
use super::reader::{ColumnMap, Columns, Reader, Units, number, read_text, unwritable};
use crate::error::{Error, Result};
use crate::quantity::{Length, UM_PER_MM};

/// The reader of this format.
pub struct Csv;

impl Reader for Csv {
    fn format(&self) -> &'static str {
        "csv"
    }

    fn is_directory(&self) -> bool {
        false
    }

    fn has_columns(&self) -> bool {
        true
    }

    fn files(&self, path: &Path) -> Vec<PathBuf> {
        vec![path.to_owned()]
    }

    fn read(&self, path: &Path, columns: Option<&ColumnMap>, frame: Frame) -> Result<Field> {
        let columns = columns.ok_or_else(|| Error::program("field::table", "declared columns"))?;
        read(path, columns, frame)
    }

    /// One row a point, failed ones with empty cells.
    fn write(&self, path: &Path, grid: &Grid, frame: Frame) -> Result<Option<ColumnMap>> {
        let mut text = String::from("x_mm,y_mm,ux_um,uy_um\n");
        for (p, u) in grid.points.iter().zip(&grid.displacement) {
            let [ux, uy] = frame.vector(*u).map(|u| u * UM_PER_MM);
            // writing to a String cannot fail
            let _ = if ux.is_finite() && uy.is_finite() {
                writeln!(text, "{:.5},{:.5},{ux:.6},{uy:.6}", p[0], p[1])
            } else {
                writeln!(text, "{:.5},{:.5},,", p[0], p[1])
            };
        }
        std::fs::write(path, text).map_err(|e| unwritable(path, &e))?;
        let [x, y, ux, uy] = ["x_mm", "y_mm", "ux_um", "uy_um"].map(String::from);
        Ok(Some(ColumnMap {
            columns: Columns { x, y, ux, uy },
            units: Units {
                coordinates: "mm".into(),
                displacements: "um".into(),
            },
        }))
    }
}

/// Read the columns of the file `path` as a field in `frame`.
///
/// # Errors
/// Of the input: a missing, empty or non-text file, an unknown or repeated column (with the columns there are), a
/// row of another length or a cell that is not a number (with line and column), no measured point.
pub fn read(path: &Path, map: &ColumnMap, frame: Frame) -> Result<Field> {
    let ColumnMap { columns, units } = map;
    let coordinate_mm = Length::parse("units.coordinates", &units.coordinates)?.in_mm();
    let displacement_mm = Length::parse("units.displacements", &units.displacements)?.in_mm();
    let text = read_text(path)?;
    let wanted = [
        ("x", &columns.x),
        ("y", &columns.y),
        ("ux", &columns.ux),
        ("uy", &columns.uy),
    ];
    let (mut reader, headers) = opened(path, &text)?;
    if headers.is_empty() {
        return Err(
            Error::input(path.display(), "a header line and rows of numbers")
                .found("an empty file"),
        );
    }
    let mut column = [0; 4];
    for (slot, (key, name)) in column.iter_mut().zip(wanted) {
        *slot = find_column(path, &headers, key, name)?;
    }
    let scale = [
        coordinate_mm,
        coordinate_mm,
        displacement_mm,
        displacement_mm,
    ];
    let mut field = Field {
        points: Vec::new(),
        displacement: Vec::new(),
        frame,
        grid: None,
        rejected: Rejected::default(),
        outlying: Vec::new(),
        fringe_frequency_per_mm: None,
        subset_mm: None,
        files: vec![path.to_owned()],
    };
    let mut record = StringRecord::new();
    while reader
        .read_record(&mut record)
        .map_err(|e| Error::input(path.display(), "rows of text").found(e))?
    {
        let place = || {
            let line = record.position().map_or(0, |p| line_at(&text, p.byte()));
            format!("{}:{line}", path.display())
        };
        if record.len() != headers.len() {
            let expected = format!("{} cells as in the header", headers.len());
            return Err(Error::input(place(), expected).found(format!("{} cells", record.len())));
        }
        let mut row = [0.0; 4];
        for (k, (_, name)) in wanted.iter().enumerate() {
            let cell = record.get(column[k]).unwrap_or("");
            let at = || format!("{}, column \"{name}\"", place());
            row[k] = length_mm(cell, scale[k], at)?;
        }
        if row.iter().any(|value| value.is_nan()) {
            field.rejected.missing += 1;
        } else {
            field.points.push(frame.point([row[0], row[1]]));
            field.displacement.push(frame.vector([row[2], row[3]]));
        }
    }
    if field.is_empty() {
        let found = format!("{} rows, none complete", field.rejected.missing);
        return Err(Error::input(path.display(), "at least one measured point").found(found));
    }
    Ok(field)
}

/// The column names of a table.
///
/// # Errors
/// Of the input: a missing, empty or non-text file.
pub fn header(path: &Path) -> Result<Vec<String>> {
    let text = read_text(path)?;
    let (_, headers) = opened(path, &text)?;
    Ok(headers.iter().map(String::from).collect())
}

/// A reader of the rows of a table, and its header.
fn opened<'a>(path: &Path, text: &'a str) -> Result<(csv::Reader<&'a [u8]>, StringRecord)> {
    let mut reader = ReaderBuilder::new()
        .delimiter(delimiter(text))
        .comment(Some(b'#'))
        .trim(Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let headers = reader
        .headers()
        .map_err(|e| Error::input(path.display(), "a header line").found(e))?
        .clone();
    Ok((reader, headers))
}

/// The column called `name`, which must be there once.
fn find_column(path: &Path, headers: &StringRecord, key: &str, name: &str) -> Result<usize> {
    let mut found = headers
        .iter()
        .enumerate()
        .filter(|(_, header)| *header == name.trim());
    match (found.next(), found.next()) {
        (Some((index, _)), None) => Ok(index),
        (first, _) => {
            let there: Vec<_> = headers
                .iter()
                .map(|header| format!("\"{header}\""))
                .collect();
            let how = if first.is_some() {
                "one column of this name only"
            } else {
                "a column of the file"
            };
            Err(Error::input(
                format!("columns.{key}"),
                format!("{how}: {}", there.join(", ")),
            )
            .found(format!("\"{name}\""))
            .within(path.display()))
        }
    }
}

/// A cell in mm, `scale` mm a unit: NaN where it is empty, which means not measured.
fn length_mm(cell: &str, scale: f64, at: impl Fn() -> String) -> Result<f64> {
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    let length = scale * number(cell).ok_or_else(|| not_a_number(at(), cell))?;
    if length.abs() > FARTHEST_MM {
        let error = Error::input(at(), "a length below 1e5 mm").found(cell);
        return Err(error.hint("check the declared units"));
    }
    Ok(length)
}

fn not_a_number(place: String, cell: &str) -> Error {
    let error = Error::input(place, "a number, NaN or an empty cell").found(cell);
    let comma = number(&cell.replacen(',', ".", 1)).is_some();
    if comma {
        error.hint("export with a decimal point, not a decimal comma")
    } else {
        error
    }
}

/// The delimiter that occurs most often in the first line that is no comment, outside quotes; a comma if none does.
fn delimiter(text: &str) -> u8 {
    let header = text
        .lines()
        .find(|line| !line.starts_with('#') && !line.trim().is_empty())
        .unwrap_or("");
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for byte in header.bytes() {
        quoted ^= byte == b'"';
        if let Some((_, count)) = counts
            .iter_mut()
            .find(|(delimiter, _)| !quoted && *delimiter == byte)
        {
            *count += 1;
        }
    }
    // the first of equals: a comma before a semicolon before a tab
    counts
        .iter()
        .rev()
        .max_by_key(|(_, count)| *count)
        .map_or(b',', |(delimiter, _)| *delimiter)
}

/// Line of the record whose reading began at `byte`: blank and comment lines before it were skipped unseen.
fn line_at(text: &str, byte: u64) -> usize {
    let mut start = usize::try_from(byte).unwrap_or(0).min(text.len());
    let bytes = text.as_bytes();
    while let Some(&first) = bytes.get(start) {
        match first {
            b'\n' | b'\r' => start += 1,
            b'#' => {
                start += bytes[start..]
                    .iter()
                    .position(|b| *b == b'\n')
                    .unwrap_or(bytes.len() - start)
            }
            _ => break,
        }
    }
    1 + bytes[..start].iter().filter(|b| **b == b'\n').count()
}
