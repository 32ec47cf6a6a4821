//! The units of a table: by the file, by the user, or by its program's habit; asked for where nobody says them.

use std::fmt::Write;
use std::path::Path;

use super::table_options::TableOptions;
use crate::error::{Error, Result};
use crate::field::programs::FoundUnit;
use crate::field::{ColumnMap, Columns, DATA_AXES, PIXEL, Units, conventions, table};

/// A table whose units are to be settled.
pub struct UnitQuestion<'a> {
    pub csv: &'a Path,
    /// The line of its header.
    pub line: usize,
    pub label: &'a str,
    pub columns: &'a Columns,
    pub found: [FoundUnit; 2],
    pub sigma_in_pixels: bool,
}

impl UnitQuestion<'_> {
    /// Units of the coordinates and of the displacements; what was assumed is added to `said`.
    ///
    /// # Errors
    /// Of the input: a unit that nothing states, pixels of unknown size, an option that contradicts the file or is not used.
    pub fn units(&self, user: &TableOptions, said: &mut String) -> Result<[&'static str; 2]> {
        let units = [self.of_pair(0, user, said)?, self.of_pair(1, user, said)?];
        match (units.iter().position(|u| *u == PIXEL), user.mm_per_pixel) {
            (Some(k), None) => {
                let [a, b] = self.pair(k);
                Err(Error::input(self.place(), "calibrated columns, in a unit of length")
                    .found(format!("the columns {a}, {b} in pixels"))
                    .hint("export the field with its calibration, or say the size of a pixel: --mm-per-pixel MM"))
            }
            (None, Some(size)) if !self.sigma_in_pixels && user.subset_px.is_none() => {
                let all = [self.pair(0), self.pair(1)].concat().join(", ");
                let expected = format!(
                    "no such option, because {} has {all} in {}",
                    self.csv.display(),
                    units.join(" and ")
                );
                Err(Error::input("--mm-per-pixel", expected)
                    .found(size)
                    .hint("leave it out"))
            }
            (None, Some(_)) => {
                let _ = writeln!(
                    said,
                    "  --mm-per-pixel is the scale of sigma and subsets alone: coordinates are in {}",
                    units[0]
                );
                Ok(units)
            }
            _ => Ok(units),
        }
    }

    /// Names of both coordinates or of both displacements.
    fn pair(&self, k: usize) -> [&str; 2] {
        let Columns { x, y, ux, uy, .. } = self.columns;
        if k == 0 { [x, y] } else { [ux, uy] }
    }

    fn place(&self) -> String {
        format!("--csv {}:{}", self.csv.display(), self.line)
    }

    fn of_pair(&self, k: usize, user: &TableOptions, said: &mut String) -> Result<&'static str> {
        let ([a, b], label) = (self.pair(k), self.label);
        let given = user.units.map(|units| units[k]);
        match (self.found[k], given) {
            (FoundUnit::Stated(unit), Some(other)) if unit != other => {
                let expected = format!("{unit}, as {} says of {a}, {b}", self.csv.display());
                Err(Error::input("--units", expected)
                    .found(other)
                    .hint("leave --units out"))
            }
            (FoundUnit::Stated(unit), _) | (_, Some(unit)) => Ok(unit),
            (FoundUnit::Usual(PIXEL), None) => Ok(PIXEL),
            (FoundUnit::Usual(unit), None)
                if user.mm_per_pixel.is_some() && !self.sigma_in_pixels =>
            {
                let _ = writeln!(
                    said,
                    "  {a}, {b}: pixels, by --mm-per-pixel (without it {unit}, as {label} writes)"
                );
                Ok(PIXEL)
            }
            (FoundUnit::Usual(unit), None) => {
                let _ = writeln!(
                    said,
                    "  {a}, {b}: {unit}, as {label} writes where the file says no unit; if not, give --units or --mm-per-pixel"
                );
                Ok(unit)
            }
            (FoundUnit::Unknown, None) if user.mm_per_pixel.is_some() => Ok(PIXEL),
            (FoundUnit::Unknown, None) => Err(self.question([a, b])?),
        }
    }

    /// The question for a unit, with what the coordinates look like.
    ///
    /// # Errors
    /// What is wrong with the numbers goes first.
    fn question(&self, [a, b]: [&str; 2]) -> Result<Error> {
        let map = ColumnMap {
            columns: self.columns.clone(),
            units: Units::new("mm", "mm"),
        };
        let field = table::read(self.csv, &map, DATA_AXES)?;
        let seen = if conventions::is_of_pixels(&field, 1.0) {
            "; every coordinate is a whole number on a grid, as pixels are"
        } else {
            ""
        };
        Ok(Error::input(self.place(), "a unit of length")
            .found(format!("the columns {a}, {b} without a unit that is known{seen}"))
            .hint("say it: --mm-per-pixel MM if they are pixels (the size of one on the specimen), or --units mm (m, um, nm, in; two for coordinates,displacements); measurement.columns and measurement.units hold the answer"))
    }
}
