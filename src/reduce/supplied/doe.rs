//! The design as a table: `row`, then one column a parameter.

use std::fmt::Write;
use std::path::Path;

use csv::{ReaderBuilder, Trim};

use super::super::design::Dimension;
use crate::error::{Error, Result};

/// Column of the number of a row, from 1.
const ROW: &str = "row";

/// The table of a design.
pub fn text(dimensions: &[Dimension], rows: &[Vec<f64>]) -> String {
    let mut text = String::from(ROW);
    for d in dimensions {
        text += ",";
        text += &d.name;
    }
    text += "\n";
    for (k, row) in rows.iter().enumerate() {
        // writing to a String cannot fail
        let _ = write!(text, "{}", k + 1);
        for value in row {
            let _ = write!(text, ",{value}");
        }
        text += "\n";
    }
    text
}

/// Numbers of the rows, and their values in the order of `names`.
pub(super) fn read(path: &Path, names: &[&str]) -> Result<Vec<(u64, Vec<f64>)>> {
    let wanted = || {
        Error::input(
            path.display(),
            format!("a table with the columns {ROW},{}", names.join(",")),
        )
    };
    let hint = "plychain design-of-experiments MODEL --out doe.csv writes one for this model";
    let mut reader = ReaderBuilder::new()
        .trim(Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|e| wanted().found(e).hint(hint))?;
    let headers = reader.headers().map_err(|e| wanted().found(e))?.clone();
    let column = |name: &str| headers.iter().position(|h| h == name);
    let lacks = |name: &str| wanted().found(format!("no column {name}")).hint(hint);
    let number = column(ROW).ok_or_else(|| lacks(ROW))?;
    let columns: Vec<usize> = names
        .iter()
        .map(|name| column(name).ok_or_else(|| lacks(name)))
        .collect::<Result<_>>()?;
    if let Some(other) = headers.iter().find(|h| *h != ROW && !names.contains(h)) {
        return Err(wanted().found(format!("a column {other}")).hint(
            "what varies in the design and is no parameter of the model would be taken for scatter",
        ));
    }
    let mut rows: Vec<(u64, Vec<f64>)> = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let place = format!("{}: row {}", path.display(), k + 1);
        let record =
            record.map_err(|e| Error::input(&place, "as many cells as columns").found(e))?;
        let own: u64 = record[number]
            .parse()
            .map_err(|_| Error::input(&place, "a whole number in row").found(&record[number]))?;
        if rows.iter().any(|(n, _)| *n == own) {
            return Err(Error::input(place, "every row once").found(format!("row {own} again")));
        }
        let value = |&c: &usize| {
            let value = record[c].parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| {
                Error::input(&place, format!("a number in {}", &headers[c])).found(&record[c])
            })
        };
        rows.push((own, columns.iter().map(value).collect::<Result<_>>()?));
    }
    if rows.is_empty() {
        return Err(wanted().found("no row"));
    }
    Ok(rows)
}
