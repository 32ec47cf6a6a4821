//! The table that a testing machine or a measuring program writes: a row a picture, or many.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{cells, in_place_of, plain};

/// Rows of cells below their names.
pub struct MachineFile {
    pub names: Vec<String>,
    /// With the line of the file that each stands in.
    pub rows: Vec<(usize, Vec<String>)>,
    /// Whether numbers have a decimal comma.
    pub has_commas: bool,
}

/// A cell without blanks and quotation marks around it.
fn cell(text: &str) -> String {
    text.trim().trim_matches('"').trim().to_string()
}

fn number(cell: &str, has_commas: bool) -> Option<f64> {
    let text = cell.replace('\u{2212}', "-");
    let text = if has_commas {
        text.replace(',', ".")
    } else {
        text
    };
    text.parse().ok().filter(|v: &f64| v.is_finite())
}

/// Whether most cells that are not empty are numbers, and there are some.
fn is_of_numbers(cells: &[String], has_commas: bool) -> bool {
    let full = cells.iter().filter(|c| !c.is_empty()).count();
    let numbers = cells.iter().filter(|c| number(c, has_commas).is_some());
    2 * numbers.count() >= full && full > 1
}

impl MachineFile {
    /// Read a file.
    ///
    /// # Errors
    /// Of the input: a file that cannot be read, or has no row of numbers below names.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display();
        let bytes =
            std::fs::read(path).map_err(|e| Error::input(&place, "a table of forces").found(e))?;
        if let Some((found, hint)) = in_place_of(&bytes) {
            let error = Error::input(&place, "a table of forces, as CSV");
            return Err(error.found(found).hint(hint));
        }
        let text = match String::from_utf8(plain(bytes)) {
            Ok(text) => text,
            // Windows-1252, whose letters beyond ASCII are in names only
            Err(e) => e.as_bytes().iter().map(|b| char::from(*b)).collect(),
        };
        let tables = [';', '\t', ','].map(|delimiter| Self::split(&text, delimiter));
        tables.into_iter().flatten().next().ok_or_else(|| {
            Error::input(
                place,
                "rows of numbers below a row of names, between ; , or tabs",
            )
            .found("none")
            .hint("export picture number (or name) and force as CSV, with the names of the columns")
        })
    }

    /// By a delimiter, if that makes a table of it.
    fn split(text: &str, delimiter: char) -> Option<Self> {
        let lines: Vec<Vec<String>> = text
            .lines()
            .map(|line| cells(line, |c| c == delimiter).map(cell).collect())
            .collect();
        let is_comma = |c: &String| {
            let parts: Vec<&str> = c.trim_start_matches(['-', '+']).split(',').collect();
            let digits = |p: &&str| !p.is_empty() && p.bytes().all(|b| b.is_ascii_digit());
            parts.len() == 2 && parts.iter().all(digits)
        };
        let has_commas = delimiter != ',' && lines.iter().flatten().any(is_comma);
        let first = lines
            .iter()
            .position(|cells| is_of_numbers(cells, has_commas))?;
        let mut names = lines[..first]
            .iter()
            .rev()
            .find(|cells| cells.iter().any(|c| !c.is_empty()))?
            .clone();
        // a row of units below that of names
        if names.iter().all(|n| n.is_empty() || is_unit(n)) && first > 1 {
            let above = &lines[first - 2];
            names = names
                .iter()
                .enumerate()
                .map(|(k, unit)| {
                    let unit = unit.trim_matches(['[', ']', '(', ')']);
                    format!("{} [{unit}]", above.get(k).map_or("", String::as_str))
                })
                .collect();
        }
        let rows = lines.into_iter().enumerate().skip(first);
        let rows = rows
            .filter(|(_, cells)| is_of_numbers(cells, has_commas))
            .map(|(k, cells)| (k + 1, cells))
            .collect();
        Some(Self {
            names,
            rows,
            has_commas,
        })
    }

    /// A number of a row; none where there is none.
    pub fn number(&self, row: usize, column: usize) -> Option<f64> {
        number(self.cell(row, column), self.has_commas)
    }

    pub fn cell(&self, row: usize, column: usize) -> &str {
        let cells = self.rows.get(row).map(|(_, cells)| cells);
        cells.and_then(|c| c.get(column)).map_or("", String::as_str)
    }
}

/// A unit alone: `[kN]`, `(mm)`, `s`.
fn is_unit(cell: &str) -> bool {
    let bracketed = cell.starts_with(['[', '(']) && cell.ends_with([']', ')']);
    bracketed || ["N", "kN", "mm", "s", "V", "-", "%", "lbf", "MPa"].contains(&cell)
}
