//! What an experiment says in a report: pieces of a section and maps, without knowing how they are shown.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Undeclared;
use crate::section::{Piece, Table, TableCell, row};

/// An experiment's part of a report.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct ExperimentSection {
    pub name: String,
    pub pieces: Vec<Piece>,
    /// What should be known before the numbers are used.
    pub warnings: Vec<String>,
    /// What `report.json` says of the experiment.
    #[serde(skip)]
    pub value: Value,
    #[serde(skip)]
    pub maps: Vec<SectionMap>,
}

/// Values between -1 and 1 on a regular grid over a rectangle.
#[derive(Debug, Clone)]
pub struct SectionMap {
    pub name: String,
    pub title: String,
    /// Along length and width.
    pub grid: [usize; 2],
    pub size_mm: [f64; 2],
    /// Row by row from low y.
    pub values: Vec<f64>,
}

/// Effects that nobody declared.
pub fn undeclared_table(found: &[Undeclared]) -> Table {
    let header = [
        "disturbance",
        "unit",
        "plausible",
        "log Bayes factor",
        "amplitude if it acts",
        "moves the constants by, prior sd",
    ];
    let rows = found.iter().map(|u| {
        let shifts: Vec<String> = u.shift_sds.iter().map(|s| format!("{s:+.2}")).collect();
        let cells = [
            TableCell::from(u.parameter),
            TableCell::three(u.plausible),
            TableCell::signed(u.log_bayes_factor, 1),
            TableCell::mean_sd(Some(u.amplitude)),
            shifts.join(" ").into(),
        ];
        row(u.name, cells)
    });
    Table::new("What may act that nobody declared", header, rows)
}
