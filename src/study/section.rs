//! What an experiment says in a report: tables, sentences and maps, without knowing how they are shown.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Undeclared;
use crate::quantity::{plus_minus, three_digits};

/// An experiment's part of a report.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ExperimentSection {
    pub name: String,
    pub tables: Vec<SectionTable>,
    /// What should be known before the numbers are used.
    pub warnings: Vec<String>,
    /// What `report.json` says of the experiment.
    #[serde(skip)]
    pub value: Value,
    #[serde(skip)]
    pub maps: Vec<SectionMap>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SectionTable {
    pub title: String,
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// Sentences below it.
    pub notes: Vec<String>,
}

/// Values between -1 and 1 on a regular grid over a rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct SectionMap {
    pub name: String,
    pub title: String,
    /// Along length and width.
    pub grid: [usize; 2],
    pub size_mm: [f64; 2],
    /// Row by row from low y.
    pub values: Vec<f64>,
}

impl SectionTable {
    pub fn new(title: &str, header: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self {
            title: title.into(),
            header: header.iter().map(|h| (*h).to_string()).collect(),
            rows,
            notes: Vec::new(),
        }
    }

    /// Effects that nobody declared.
    pub fn of_undeclared(found: &[Undeclared]) -> Self {
        const HEADER: [&str; 6] = [
            "disturbance",
            "unit",
            "plausible",
            "log Bayes factor",
            "amplitude if it acts",
            "moves the constants by, prior sd",
        ];
        let row = |u: &Undeclared| {
            let [amplitude, sd] = u.amplitude;
            let shifts: Vec<String> = u.shift_sds.iter().map(|s| format!("{s:+.2}")).collect();
            vec![
                u.name.into(),
                u.parameter.into(),
                three_digits(u.plausible),
                format!("{:+.1}", u.log_bayes_factor),
                plus_minus(amplitude, sd),
                shifts.join(" "),
            ]
        };
        let rows = found.iter().map(row).collect();
        Self::new("What may act that nobody declared", &HEADER, rows)
    }
}
