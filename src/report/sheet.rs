//! Tables of text cells: what figures are drawn from, and what is kept of them as CSV beside the figure.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files;

/// A named table. Every figure is drawn from sheets alone, so that a run's figures can be made again from its folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sheet {
    /// Name, which is the file's stem.
    pub name: String,
    /// Column names with their units.
    pub header: Vec<String>,
    /// Cells; an empty cell is a missing value.
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    /// An empty sheet.
    pub fn new(name: impl Into<String>, header: &[&str]) -> Self {
        Self {
            name: name.into(),
            header: header.iter().map(|h| (*h).to_string()).collect(),
            rows: Vec::new(),
        }
    }

    /// Index of the column called `name`.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|h| h == name)
    }

    /// The cells of a column; missing cells if there is no such column.
    pub fn texts(&self, name: &str) -> Vec<&str> {
        let k = self.column(name);
        let cell = |row: &'_ Vec<String>| -> Option<usize> { k.filter(|k| *k < row.len()) };
        self.rows
            .iter()
            .map(|row| cell(row).map_or("", |k| row[k].as_str()))
            .collect()
    }

    /// The numbers of a column; NaN where there is none.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let texts = self.texts(name);
        texts
            .iter()
            .map(|t| t.parse().unwrap_or(f64::NAN))
            .collect()
    }

    /// The rows whose cell in column `name` is `value`.
    pub fn only(&self, name: &str, value: &str) -> Self {
        let keep = self.texts(name);
        let rows = self.rows.iter().zip(keep);
        Self {
            name: self.name.clone(),
            header: self.header.clone(),
            rows: rows
                .filter(|(_, v)| *v == value)
                .map(|(r, _)| r.clone())
                .collect(),
        }
    }

    /// The different values of a column in order of first appearance.
    pub fn distinct(&self, name: &str) -> Vec<String> {
        let mut seen: Vec<String> = Vec::new();
        for text in self.texts(name) {
            if seen.last().is_none_or(|last| last != text) && !seen.iter().any(|s| s == text) {
                seen.push(text.to_string());
            }
        }
        seen
    }

    /// Write `NAME.csv` into a folder.
    ///
    /// # Errors
    /// The input's fault if the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let failed = |e: &dyn std::fmt::Display| {
            Error::program(&self.name, "a table that CSV can hold").found(e)
        };
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record(&self.header).map_err(|e| failed(&e))?;
        for row in &self.rows {
            out.write_record(row).map_err(|e| failed(&e))?;
        }
        let text = out.into_inner().map_err(|e| failed(&e))?;
        files::replace(&folder.join(format!("{}.csv", self.name)), text)
    }

    /// Read a CSV file.
    ///
    /// # Errors
    /// The input's fault, with file and line, if it is no table.
    pub fn read(path: &Path) -> Result<Self> {
        let failed = |e: csv::Error| {
            let line = e.position().map_or(1, csv::Position::line);
            Error::input(
                format!("{}:{line}", path.display()),
                "a figure's table as CSV",
            )
            .found(e)
        };
        let mut reader = csv::Reader::from_path(path).map_err(failed)?;
        let header = reader.headers().map_err(failed)?;
        let header = header.iter().map(String::from).collect();
        let rows = reader
            .records()
            .map(|r| Ok(r.map_err(failed)?.iter().map(String::from).collect()))
            .collect::<Result<_>>()?;
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
        Ok(Self {
            name: stem.unwrap_or_default(),
            header,
            rows,
        })
    }
}

/// A number that reads back to the same bits; empty where it is not finite.
pub fn exact(value: f64) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else {
        String::new()
    }
}

/// A number with so many decimals; empty where it is not finite.
pub fn rounded(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        format!("{value:.decimals$}")
    } else {
        String::new()
    }
}
