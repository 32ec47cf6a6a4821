//! The cells of one row of a table.

use std::path::Path;

use super::cells::number;
use super::measured::FARTHEST_MM;
use super::reader::{ColumnMap, LEAST_CORRELATION};
use super::sheet::Sheet;
use crate::error::{Error, Result};

/// Coefficients may be above 1 by so much, as single precision rounds them.
const ROUNDED: f64 = 1e-3;

/// Where the declared columns are and what their units are.
pub(super) struct CsvRow<'a> {
    /// Index, name and mm a unit of x, y, ux, uy; below 0 where the sign is changed.
    lengths: [(usize, &'a str, f64); 4],
    /// The same of the standard deviation; without a unit it tells failed points alone.
    sigma: Option<(usize, &'a str, Option<f64>)>,
    correlation: Option<(usize, &'a str)>,
    /// Whether the places are those of the deformed state.
    deformed: bool,
    /// Whether the decimal sign is a comma.
    comma: bool,
}

/// What a row says of its point.
pub(super) enum Point {
    /// A cell is empty or NaN.
    Missing,
    /// The export says that the correlation failed.
    Failed,
    /// The correlation coefficient is below [`LEAST_CORRELATION`].
    Faint,
    /// Place, displacement, in mm along x and y, and standard deviation, mm.
    Measured {
        at: [f64; 2],
        u: [f64; 2],
        sigma: f64,
    },
}

impl<'a> CsvRow<'a> {
    /// The columns of `map` in the table `sheet` of the file `path`.
    ///
    /// # Errors
    /// Of the input: an unknown or repeated column, with the columns there are; an unknown unit.
    pub fn new(path: &Path, map: &'a ColumnMap, sheet: &Sheet) -> Result<Self> {
        let ColumnMap { columns, units } = map;
        let [coordinate, displacement] = units.in_mm()?;
        let find = |key: &str, name: &'a str| -> Result<(usize, &'a str)> {
            Ok((find_column(path, &sheet.names, key, name)?, name))
        };
        let length = |key: &str, name: &'a str, scale: f64| -> Result<(usize, &'a str, f64)> {
            let there = sheet.names.iter().any(|header| header == name.trim());
            match name.trim().strip_prefix('-').filter(|_| !there) {
                Some(turned) => Ok((find(key, turned)?.0, turned, -scale)),
                None => Ok((find(key, name)?.0, name, scale)),
            }
        };
        let sigma = match &columns.sigma {
            Some(name) => {
                let (index, name) = find("sigma", name)?;
                Some((index, name, units.sigma_in_mm()?))
            }
            None => None,
        };
        let correlation = columns.correlation.as_deref();
        Ok(Self {
            lengths: [
                length("x", &columns.x, coordinate)?,
                length("y", &columns.y, coordinate)?,
                length("ux", &columns.ux, displacement)?,
                length("uy", &columns.uy, displacement)?,
            ],
            sigma,
            correlation: correlation
                .map(|name| find("correlation", name))
                .transpose()?,
            deformed: columns.deformed,
            comma: sheet.comma,
        })
    }

    /// Whether the standard deviations are lengths.
    pub fn keeps_sigma(&self) -> bool {
        self.sigma.is_some_and(|(_, _, scale)| scale.is_some())
    }

    /// The point of a row, whose file and line `place` tells.
    ///
    /// # Errors
    /// Of the input: a cell that is not a number, a length that is none of a specimen.
    pub fn point(&self, cells: &[&str], place: &dyn Fn() -> String) -> Result<Point> {
        let at = |name: &str| format!("{}, column \"{name}\"", place());
        let plain = |index: usize, name: &str| -> Result<f64> {
            let cell = cells.get(index).copied().unwrap_or("");
            number(cell, self.comma).ok_or_else(|| self.not_a_number(at(name), cell))
        };
        let length_mm = |index: usize, name: &str, scale: f64| -> Result<f64> {
            let length = scale * plain(index, name)?;
            if length.abs() > FARTHEST_MM {
                let found = cells.get(index).copied().unwrap_or("");
                let error = Error::input(at(name), "a length below 1e5 mm").found(found);
                return Err(error.hint("check the declared units"));
            }
            Ok(length)
        };
        let mut values = [0.0; 4];
        for (value, (index, name, scale)) in values.iter_mut().zip(self.lengths) {
            *value = length_mm(index, name, scale)?;
        }
        let sigma = match self.sigma {
            Some((index, name, scale)) => length_mm(index, name, scale.unwrap_or(1.0))?,
            None => 1.0,
        };
        let correlation = match self.correlation {
            Some((index, name)) => plain(index, name)?,
            None => 1.0,
        };
        if correlation > 1.0 + ROUNDED {
            let name = self.correlation.map_or("", |(_, name)| name);
            return Err(Error::input(at(name), "a correlation coefficient of at most 1").found(correlation)
                .hint("percent, or another measure? leave columns.correlation out, or export the coefficient"));
        }
        let [x, y, ux, uy] = values;
        let at = if self.deformed {
            [x - ux, y - uy]
        } else {
            [x, y]
        };
        Ok(if values.iter().any(|v| v.is_nan()) {
            Point::Missing
        } else if sigma < 0.0 || sigma.is_nan() || correlation.is_nan() {
            // failed points have a sigma of -1 in VIC and DICe, or none
            Point::Failed
        } else if correlation < LEAST_CORRELATION {
            Point::Faint
        } else {
            Point::Measured {
                at,
                u: [ux, uy],
                sigma,
            }
        })
    }

    fn not_a_number(&self, place: String, cell: &str) -> Error {
        let error = Error::input(place, "a number, or a word for no value such as NaN").found(cell);
        if number(cell, !self.comma).is_some() || cell.contains(',') {
            return error.hint("one decimal sign in the whole file and no thousands separators: export with a decimal point");
        }
        error.hint("leave the cell empty where nothing was measured, or take the column out of measurement.columns")
    }
}

/// The column called `name`, which must be there once.
pub(super) fn find_column(path: &Path, headers: &[String], key: &str, name: &str) -> Result<usize> {
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
