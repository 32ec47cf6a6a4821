//! The figures, their numbers and the page of a run, written into its folder.

use std::path::Path;

use serde_json::{Value, json};

use super::figures;
use super::html::html;
use super::numbers::{CandidateLine, columns, write};
use super::page::{AVERAGED, FIGURES, Page};
use super::{run, tracing::TracingReport};
use crate::error::{Error, Result};
use crate::files;

impl Page {
    /// Write figures, their numbers, and `report.html` into a run's folder.
    ///
    /// # Errors
    /// The input's fault if a file cannot be written; the program's if a figure cannot be drawn.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let into = folder.join(FIGURES);
        files::make_folder(&into)?;
        write_numbers(self, &into)?;
        let figures = figures::all(self)?;
        for figure in figures.iter().filter(|figure| figure.has_file) {
            let path = into.join(format!("{}.svg", figure.name));
            files::replace(&path, figure.file())?;
        }
        if !self.truth.is_empty() {
            files::write_json(&folder.join("truth.json"), &self.truth)?;
        }
        let path = folder.join("report.html");
        files::replace(&path, html(&run::document(self), &figures))
    }
}

/// The numbers of every figure, one JSON each.
fn write_numbers(page: &Page, into: &Path) -> Result<()> {
    for (k, data) in page.figures.iter().enumerate() {
        data.write(into, &k.to_string())?;
    }
    page.quoted.write(into, AVERAGED)?;
    let failed = |e| Error::program("figures", "numbers that JSON can hold").found(e);
    let mut numbers = vec![("intervals".to_string(), columns(&page.intervals()))];
    numbers.push(("blind-spots".into(), columns(&blind_spots(page))));
    for (k, round) in page.report.rounds.iter().enumerate() {
        let candidates = round.tracing.as_ref().map_or_else(Vec::new, candidates);
        numbers.push((format!("candidates-{k}"), columns(&candidates)));
    }
    for (figure, columns) in numbers {
        let columns = columns.map_err(failed)?;
        if !columns.is_empty() {
            write(into, &figure, &json!(columns))?;
        }
    }
    Ok(())
}

fn candidates(tracing: &TracingReport) -> Vec<CandidateLine<'_>> {
    let candidates = tracing.candidates.iter();
    let lines = candidates.map(|c| CandidateLine {
        effect: &c.effect,
        inclusion_probability: c.inclusion_probability,
        log_bayes_factor: c.log_bayes_factor,
        explained_fraction: c.explained_fraction,
        detectable: c.detectable,
        accepted: tracing.accepted.contains(&c.effect),
    });
    lines.collect()
}

/// What each unseen effect would do, with a shift of every constant.
fn blind_spots(page: &Page) -> Vec<Value> {
    let constants = page.constants();
    let line = |spot: &crate::trace::BlindSpot| {
        let mut line = json!({
            "effect": spot.name(), "plausible": spot.plausible, "unit": spot.unit, "would_be_seen": spot.would_be_seen,
        });
        for constant in &constants {
            line[format!("{constant}_shift_percent")] = json!(spot.shift(constant));
        }
        line
    };
    page.report.blind_spots().iter().map(line).collect()
}
