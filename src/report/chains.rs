//! What chains are worth, parameter by parameter.

use super::section::{Section, Table, TableCell, row};
use crate::diagnose::Verdict;

/// The numbers of every parameter, and the verdict in a line.
pub fn section(verdict: &Verdict) -> Section {
    let header = [
        "parameter",
        "mean",
        "sd",
        "q2.5",
        "median",
        "q97.5",
        "mcse",
        "R-hat",
        "ESS bulk",
        "ESS tail",
        "tau",
    ];
    let rows = verdict.rows.iter().map(|r| {
        let moments = TableCell::as_precise_as(r.sd, [r.mean, r.sd, r.low, r.median, r.high]);
        let worth = [
            TableCell::three(r.mcse_mean),
            TableCell::fixed(r.rhat, 4),
            TableCell::fixed(r.ess_bulk, 0),
            TableCell::fixed(r.ess_tail, 0),
            TableCell::fixed(r.tau, 1),
        ];
        row(&r.name, moments.into_iter().chain(worth))
    });
    Section::default()
        .with(Table::new("", header, rows))
        .say(verdict.line())
}
