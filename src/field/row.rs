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
    /// Index and mm a unit of the coordinate and the displacement out of the plane, where a program's table has both.
    out_of_plane: Option<[(usize, f64); 2]>,
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
    Measured(MeasuredRow),
}

/// What a row says of a point that was measured.
pub(super) struct MeasuredRow {
    /// Place and displacement, mm along x and y.
    pub at: [f64; 2],
    pub u: [f64; 2],
    /// Coordinate and displacement out of the plane, mm; NaN without.
    pub out_of_plane: [f64; 2],
    /// Standard deviation, mm.
    pub sigma: f64,
    /// Unit of the last decimal of a standard deviation that is written as 0, mm: it is below.
    pub zero_below: Option<f64>,
}

impl MeasuredRow {
    /// A row of zeros, as programs write where they filled none.
    pub fn is_unfilled(&self) -> bool {
        [self.at, self.u] == [[0.0; 2]; 2]
    }
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
        let out_of_plane = sheet.out_of_plane(columns).and_then(|names| {
            let at = |name: &String| sheet.names.iter().position(|n| n == name);
            Some([(at(&names[0])?, coordinate), (at(&names[1])?, displacement)])
        });
        Ok(Self {
            out_of_plane,
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

    /// Whether a coefficient tells the points that did not correlate.
    pub fn has_correlation(&self) -> bool {
        self.correlation.is_some()
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
        let [z, uz] = self.beside(cells);
        let (at, z) = if self.deformed {
            ([x - ux, y - uy], z - uz)
        } else {
            ([x, y], z)
        };
        Ok(if values.iter().any(|v| v.is_nan()) {
            Point::Missing
        } else if sigma < 0.0 || sigma.is_nan() || correlation.is_nan() {
            // failed points have a sigma of -1 in VIC and DICe, or none
            Point::Failed
        } else if correlation < LEAST_CORRELATION {
            Point::Faint
        } else {
            Point::Measured(MeasuredRow {
                at,
                u: [ux, uy],
                out_of_plane: [z, uz],
                sigma,
                zero_below: self.zero_below(sigma, cells),
            })
        })
    }

    /// The coordinate and the displacement out of the plane, mm; NaN without.
    fn beside(&self, cells: &[&str]) -> [f64; 2] {
        let of = |(index, scale): (usize, f64)| {
            let cell = cells.get(index).copied().unwrap_or("");
            scale * number(cell, self.comma).unwrap_or(f64::NAN)
        };
        self.out_of_plane.map_or([f64::NAN; 2], |both| both.map(of))
    }

    /// Below what a standard deviation is that is written as 0, mm.
    fn zero_below(&self, sigma: f64, cells: &[&str]) -> Option<f64> {
        let (index, _, scale) = self.sigma.filter(|_| sigma == 0.0)?;
        Some(scale.unwrap_or(1.0) * last_decimal(cells.get(index)?)?)
    }

    fn not_a_number(&self, place: String, cell: &str) -> Error {
        let error = Error::input(place, "a number, or a word for no value such as NaN").found(cell);
        if number(cell, !self.comma).is_some() || cell.contains(',') {
            return error.hint("one decimal sign in the whole file and no thousands separators: export with a decimal point");
        }
        error.hint("leave the cell empty where nothing was measured, or take the column out of measurement.columns")
    }
}

/// The unit of the last decimal of a number that is written without an exponent.
fn last_decimal(cell: &str) -> Option<f64> {
    let (_, decimals) = cell.split_once(['.', ','])?;
    let plain = decimals.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| 10_f64.powi(-(decimals.len() as i32)))
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
