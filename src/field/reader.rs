//! What a format of measured fields has to offer, and how text files are read.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::frame::Frame;
use super::grid::Grid;
use super::measured::Field;
use crate::error::{Error, Result};
use crate::quantity::length_in_mm;

/// A format of measured fields: one file of this room, and one line of [`super::READERS`].
pub trait Reader: Sync {
    /// Its name, `measurement.format` in a model file.
    fn format(&self) -> &'static str;

    /// Whether a measurement is a directory, at the key `dir`; otherwise it is a file, at the key `file`.
    fn is_directory(&self) -> bool;

    /// What a measurement is called in a folder of its own.
    fn file_name(&self) -> &'static str;

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
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnMap {
    /// Header names.
    pub columns: Columns,
    /// Declared units.
    pub units: Units,
}

/// Header names of the columns of a table. A name after a minus sign is that column with its sign changed: `"uy": "-V"`.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Standard deviation of a displacement, as the program that correlated the images states it. Where it is not above 0
    /// the correlation failed (VIC and DICe write -1), and the point is dropped; a column that is 0 everywhere says nothing, and a 0 beside a
    /// good correlation was rounded.
    pub sigma: Option<String>,
    /// Correlation coefficient, 1 for a perfect match (ZNCC). Points below [`LEAST_CORRELATION`] are dropped.
    pub correlation: Option<String>,
    /// Whether x and y are places in the deformed state, as GOM writes them: the reference place is then x - ux, y - uy.
    #[serde(default, skip_serializing_if = "is_false")]
    pub deformed: bool,
}

/// Whether a key is left out.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde asks for a reference"
)]
fn is_false(value: &bool) -> bool {
    !value
}

/// Points with a smaller correlation coefficient are dropped: a fifth of the variance of the grey levels is then not that of the
/// reference picture (ZNSSD = 2 - 2 ZNCC, Pan et al., Applied Optics 49 (2010) 5501).
pub const LEAST_CORRELATION: f64 = 0.9;

/// Name of the unit that needs a scale.
pub const PIXEL: &str = "px";

/// Units of a table's columns, by their names in [`crate::quantity::LENGTHS`], or [`PIXEL`].
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Units {
    /// Unit of both coordinates.
    pub coordinates: String,
    /// Unit of both displacements.
    pub displacements: String,
    /// Unit of the standard deviations, that of the displacements where it is not declared. Without a scale those in pixels
    /// tell failed points and nothing else.
    pub sigma: Option<String>,
    /// Size of a pixel on the specimen, mm, where a unit is the pixel.
    pub mm_per_pixel: Option<f64>,
}

impl Columns {
    /// The columns that every table has.
    pub fn new([x, y, ux, uy]: [String; 4]) -> Self {
        Self {
            x,
            y,
            ux,
            uy,
            sigma: None,
            correlation: None,
            deformed: false,
        }
    }

    /// Keys and header names of the declared columns.
    pub fn named(&self) -> Vec<(&'static str, &str)> {
        let needed = [
            ("x", &self.x),
            ("y", &self.y),
            ("ux", &self.ux),
            ("uy", &self.uy),
        ];
        let more = [("sigma", &self.sigma), ("correlation", &self.correlation)];
        let more = more
            .into_iter()
            .filter_map(|(key, name)| Some((key, name.as_ref()?)));
        let all = needed.into_iter().chain(more);
        all.map(|(key, name)| (key, name.as_str())).collect()
    }
}

impl Units {
    /// Units of lengths alone.
    pub fn new(coordinates: &str, displacements: &str) -> Self {
        Self {
            coordinates: coordinates.into(),
            displacements: displacements.into(),
            sigma: None,
            mm_per_pixel: None,
        }
    }

    /// How many mm a unit of the coordinates and one of the displacements are.
    ///
    /// # Errors
    /// Of the input: an unknown unit, a pixel of unknown or impossible size.
    pub fn in_mm(&self) -> Result<[f64; 2]> {
        let scale = |key: &str, unit: &str| -> Result<f64> {
            if unit != PIXEL {
                return length_in_mm(key, unit);
            }
            self.mm_per_pixel.ok_or_else(|| {
                let expected = format!("a pixel's size in mm, because {key} is \"{PIXEL}\"");
                Error::input("units.mm_per_pixel", expected).found("no such key")
            })
        };
        if let Some(size) = self.mm_per_pixel.filter(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(Error::input("units.mm_per_pixel", "a length in mm above 0").found(size));
        }
        Ok([
            scale("units.coordinates", &self.coordinates)?,
            scale("units.displacements", &self.displacements)?,
        ])
    }

    /// How many mm a unit of the standard deviations is; `None` for pixels without a scale.
    ///
    /// # Errors
    /// Of the input: an unknown unit.
    pub fn sigma_in_mm(&self) -> Result<Option<f64>> {
        match self.sigma.as_deref().unwrap_or(&self.displacements) {
            PIXEL => Ok(self.mm_per_pixel),
            unit => length_in_mm("units.sigma", unit).map(Some),
        }
    }
}

/// A file of a measurement that cannot be read.
pub fn unreadable(path: &Path, error: &std::io::Error) -> Error {
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
