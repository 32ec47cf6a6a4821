//! A table as CSV: every number whole, in a column of its own.

use super::{Table, TableCell};
use crate::error::{Error, Result};

/// The columns of a mean with an sd, and of an interval, by what follows the name of the column.
const PARTS: [&str; 4] = ["_mean", "_sd", "_q2.5", "_q97.5"];

/// The table as the bytes of a CSV file.
///
/// # Errors
/// The program's fault if the table cannot be written.
pub fn csv(table: &Table) -> Result<Vec<u8>> {
    let failed =
        |e: &dyn std::fmt::Display| Error::program(&table.caption, "a table for CSV").found(e);
    let widths: Vec<usize> = (0..table.header.len())
        .map(|k| {
            table
                .rows
                .iter()
                .map(|row| width(&row[k]))
                .max()
                .unwrap_or(1)
        })
        .collect();
    let mut out = csv::Writer::from_writer(Vec::new());
    let header = table.header.iter().zip(&widths).flat_map(|(name, &width)| {
        let part = |k: usize| match width {
            1 => name.clone(),
            _ => format!("{name}{}", PARTS[k]),
        };
        (0..width).map(part).collect::<Vec<_>>()
    });
    out.write_record(header.collect::<Vec<_>>())
        .map_err(|e| failed(&e))?;
    for row in &table.rows {
        let mut fields = Vec::new();
        for (cell, width) in row.iter().zip(&widths) {
            let end = fields.len() + width;
            fields.extend(values(cell));
            fields.resize(end, String::new());
        }
        out.write_record(fields).map_err(|e| failed(&e))?;
    }
    out.into_inner().map_err(|e| failed(&e))
}

fn width(cell: &TableCell) -> usize {
    match cell {
        TableCell::MeanSd { .. } => 2,
        TableCell::Interval { .. } => 4,
        _ => 1,
    }
}

fn values(cell: &TableCell) -> Vec<String> {
    match cell {
        TableCell::Blank | TableCell::Missing => vec![String::new()],
        TableCell::Number { value, .. } | TableCell::Probability(value) => vec![value.to_string()],
        TableCell::MeanSd { mean, sd, .. } => [mean, sd].map(ToString::to_string).to_vec(),
        TableCell::Interval { mean, sd, ends } => {
            let all = [mean, sd, &ends[0], &ends[1]];
            all.map(ToString::to_string).to_vec()
        }
        other => vec![other.plain()],
    }
}
