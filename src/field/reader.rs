//! What a format of measured fields has to offer, and how text files are read.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::frame::Frame;
use super::grid::Grid;
use super::measured::Field;
use crate::error::{Error, Result};

/// A format of measured fields: one file of this room, and one line of [`super::READERS`].
pub trait Reader: Sync {
    /// Its name, `measurement.format` in a model file.
    fn format(&self) -> &'static str;

    /// Whether a measurement is a directory, at the key `dir`; otherwise it is a file, at the key `file`.
    fn is_directory(&self) -> bool;

    /// Whether the model file says which columns to read, in which units and with which origin.
    fn has_columns(&self) -> bool;

    /// The files of the measurement at `path`.
    fn files(&self, path: &Path) -> Vec<PathBuf>;

    /// Read the measurement at `path` as a field in `frame`; `columns` are there if [`Reader::has_columns`].
    ///
    /// # Errors
    /// Of the input, naming file, line and value: whatever is wrong with the files.
    fn read(&self, path: &Path, columns: Option<&ColumnMap>, frame: Frame) -> Result<Field>;

    /// Write `grid` at `path`, displacements along the loading axis and across it as `frame` has them; returns what the model
    /// file must say of the columns.
    ///
    /// # Errors
    /// Of the input: a place that cannot be written.
    fn write(&self, path: &Path, grid: &Grid, frame: Frame) -> Result<Option<ColumnMap>>;
}

impl PartialEq for dyn Reader + '_ {
    fn eq(&self, other: &Self) -> bool {
        self.format() == other.format()
    }
}

impl std::fmt::Debug for dyn Reader + '_ {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.format())
    }
}

/// The columns of a table and their units.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnMap {
    /// Header names.
    pub columns: Columns,
    /// Declared units.
    pub units: Units,
}

/// Header names of the columns of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// The point's x coordinate.
    pub x: String,
    /// The point's y coordinate.
    pub y: String,
    /// The displacement along x.
    pub ux: String,
    /// The displacement along y.
    pub uy: String,
}

/// Units of a table's columns, by their names in [`crate::quantity::Length`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Units {
    /// Unit of both coordinates.
    pub coordinates: String,
    /// Unit of both displacements.
    pub displacements: String,
}

/// The text of a file, without a byte order mark.
///
/// # Errors
/// Of the input: a file that cannot be read or is not UTF-8 (with the line of the first bad byte).
pub(super) fn read_text(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|e| unreadable(path, &e))?;
    let mut text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let bytes = e.as_bytes();
        let line = 1 + bytes[..good].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("{}:{line}", path.display()), "text in UTF-8")
            .found(format!(
                "byte 0x{:02x}",
                bytes.get(good).copied().unwrap_or(0)
            ))
            .hint("save the file as plain UTF-8 text")
    })?;
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}

/// A file of a measurement that cannot be read.
pub(crate) fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::input(path.display(), "a readable file")
        .found(error)
        .hint("paths in a model file are relative to it; --data PATH gives another place")
}

/// A file of a measurement that cannot be written.
pub(super) fn unwritable(path: &Path, error: &std::io::Error) -> Error {
    Error::input(path.display(), "a writable place").found(error)
}

/// A number of a text file: NaN (any case) is a number here, an infinity is not.
pub(super) fn number(text: &str) -> Option<f64> {
    text.parse::<f64>()
        .ok()
        .filter(|value| !value.is_infinite())
}
