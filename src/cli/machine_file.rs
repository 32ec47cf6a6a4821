//! The table that a testing machine or a measuring program writes: a row a picture, or many.

use std::path::Path;

use crate::error::{Error, Result};
use crate::field::cells::{Delimiter, comma_in, number};
use crate::field::of_settings;
use crate::files::in_place_of;

/// Rows of cells below their names.
pub struct MachineFile {
    pub names: Vec<String>,
    /// With the line of the file that each stands in.
    pub rows: Vec<(usize, Vec<String>)>,
    /// Whether numbers have a decimal comma.
    pub has_commas: bool,
}

/// Whether most cells that are not empty are numbers, and there are some.
fn is_of_numbers(cells: &[String], has_commas: bool) -> bool {
    let full = cells.iter().filter(|c| !c.is_empty()).count();
    2 * numbers_in(cells, has_commas) >= full && full > 1
}

fn numbers_in(cells: &[String], has_commas: bool) -> usize {
    let numbers = cells.iter().filter_map(|c| number(c, has_commas));
    numbers.filter(|n| n.is_finite()).count()
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
        let text = of_settings(path, &bytes)?;
        let tables = Delimiter::ALL.map(|delimiter| Self::split(&text, delimiter));
        let tables: Vec<Self> = tables.into_iter().flatten().collect();
        // a decimal comma may look like a delimiter
        let whole = tables.iter().position(Self::is_all_numbers);
        tables.into_iter().nth(whole.unwrap_or(0)).ok_or_else(|| {
            Error::input(
                place,
                "rows of numbers below a row of names, between ; , tabs or blanks",
            )
            .found("none")
            .hint("export picture number (or name) and force as CSV, with the names of the columns")
        })
    }

    fn is_all_numbers(&self) -> bool {
        let whole =
            |(_, cells): &(usize, Vec<String>)| numbers_in(cells, self.has_commas) == cells.len();
        self.rows.iter().all(whole)
    }

    /// By a delimiter, if that makes a table of it.
    fn split(text: &str, delimiter: Delimiter) -> Option<Self> {
        let cells = |line: &str| {
            let mut cells = Vec::new();
            delimiter.split(line, &mut cells);
            cells.into_iter().map(String::from).collect()
        };
        let lines: Vec<Vec<String>> = text.lines().map(cells).collect();
        let is_comma = |c: &String| comma_in(c).is_some();
        let has_commas = delimiter != Delimiter::Sign(',') && lines.iter().flatten().any(is_comma);
        let first = lines
            .iter()
            .position(|cells| is_of_numbers(cells, has_commas))?;
        let mut names = lines[..first]
            .iter()
            .rev()
            .find(|cells| cells.iter().any(|c| !c.is_empty()))?
            .clone();
        uncommented(&mut names, lines[first].len());
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
        number(self.cell(row, column), self.has_commas).filter(|v| v.is_finite())
    }

    pub fn cell(&self, row: usize, column: usize) -> &str {
        let cells = self.rows.get(row).map(|(_, cells)| cells);
        cells.and_then(|c| c.get(column)).map_or("", String::as_str)
    }
}

/// The sign of a comment before the first name goes; alone it may be the name of a column, of `count`.
fn uncommented(names: &mut Vec<String>, count: usize) {
    let Some(first) = names.first_mut() else {
        return;
    };
    let bare = first.trim_start_matches(['#', '%', ' ']).to_string();
    if !bare.is_empty() {
        *first = bare;
    } else if names.len() > count {
        names.remove(0);
    }
}

/// A unit alone: `[kN]`, `(mm)`, `s`.
fn is_unit(cell: &str) -> bool {
    let bracketed = cell.starts_with(['[', '(']) && cell.ends_with([']', ')']);
    bracketed || ["N", "kN", "mm", "s", "V", "-", "%", "lbf", "MPa"].contains(&cell)
}
