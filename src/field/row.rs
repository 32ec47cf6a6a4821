//! The cells of one row of a table.

use std::path::Path;

use csv::StringRecord;

use super::measured::FARTHEST_MM;
use super::reader::{ColumnMap, LEAST_CORRELATION, number};
use crate::error::{Error, Result};

/// Where the declared columns are and what their units are.
pub(super) struct Row<'a> {
    /// Index, name and mm a unit of x, y, ux, uy.
    lengths: [(usize, &'a str, f64); 4],
    /// The same of the standard deviation; without a unit it tells failed points alone.
    sigma: Option<(usize, &'a str, Option<f64>)>,
    correlation: Option<(usize, &'a str)>,
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

impl<'a> Row<'a> {
    /// The columns of `map` among `headers` of the file `path`.
    ///
    /// # Errors
    /// Of the input: an unknown or repeated column, with the columns there are; an unknown unit.
    pub fn new(path: &Path, map: &'a ColumnMap, headers: &StringRecord) -> Result<Self> {
        let ColumnMap { columns, units } = map;
        let [coordinate, displacement] = units.in_mm()?;
        let find = |key: &str, name: &'a str| -> Result<(usize, &'a str)> {
            Ok((find_column(path, headers, key, name)?, name))
        };
        let length = |key: &str, name: &'a str, scale: f64| -> Result<(usize, &'a str, f64)> {
            let (index, name) = find(key, name)?;
            Ok((index, name, scale))
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
    pub fn point(&self, record: &StringRecord, place: &dyn Fn() -> String) -> Result<Point> {
        let cell = |index: usize| record.get(index).unwrap_or("");
        let at = |name: &str| format!("{}, column \"{name}\"", place());
        let mut values = [0.0; 4];
        for (value, (index, name, scale)) in values.iter_mut().zip(self.lengths) {
            *value = length_mm(cell(index), scale, || at(name))?;
        }
        let sigma = match self.sigma {
            Some((index, name, scale)) => {
                length_mm(cell(index), scale.unwrap_or(1.0), || at(name))?
            }
            None => 1.0,
        };
        let correlation = match self.correlation {
            Some((index, name)) => plain(cell(index), || at(name))?,
            None => 1.0,
        };
        let [x, y, ux, uy] = values;
        Ok(if values.iter().any(|v| v.is_nan()) {
            Point::Missing
        } else if sigma <= 0.0 || sigma.is_nan() || correlation.is_nan() {
            // failed points have a sigma of -1 in VIC and DICe, or none
            Point::Failed
        } else if correlation < LEAST_CORRELATION {
            Point::Faint
        } else {
            Point::Measured {
                at: [x, y],
                u: [ux, uy],
                sigma,
            }
        })
    }
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

/// A cell without a unit: NaN where it is empty.
fn plain(cell: &str, at: impl Fn() -> String) -> Result<f64> {
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    number(cell).ok_or_else(|| not_a_number(at(), cell))
}

/// A cell in mm, `scale` mm a unit: NaN where it is empty, which means not measured.
fn length_mm(cell: &str, scale: f64, at: impl Fn() -> String) -> Result<f64> {
    let length = scale * plain(cell, &at)?;
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
