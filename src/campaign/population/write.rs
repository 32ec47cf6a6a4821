//! A population in words, as a page, and as chain files.

use std::path::{Path, PathBuf};

use maud::html;

use super::report::{Basis, Estimate, PopulationReport};
use super::sampled::Sampled;
use crate::chain::{write_csv, write_zarr};
use crate::error::{Error, Result};
use crate::files;
use crate::quantity::significant;
use crate::report::{document, table};

/// Write chains, `population.json` and `population.html` into a folder, in place of what was written there before, and return the page's path.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(report: &PopulationReport, sampled: &Sampled, folder: &Path) -> Result<PathBuf> {
    files::make_folder(folder)?;
    let store = folder.join("chain.zarr");
    if store.exists() {
        std::fs::remove_dir_all(&store)
            .map_err(|e| Error::input(store.display(), "a writable folder").found(e))?;
    }
    write_zarr(&sampled.draws, &store)?;
    write_csv(&sampled.draws, &folder.join("chain.csv"))?;
    files::write_json(&folder.join("population.json"), report)?;
    let page = folder.join("population.html");
    files::replace(&page, report.page())?;
    Ok(page)
}

impl Estimate {
    fn text(&self) -> String {
        let [mean, sd, low, high] =
            [self.mean, self.sd, self.low, self.high].map(|v| significant(v, self.sd));
        format!("{mean} +- {sd} [{low}, {high}]")
    }
}

impl Basis {
    fn text(&self) -> String {
        significant(self.value, self.percentile.sd)
    }
}

impl PopulationReport {
    fn rows(&self) -> Vec<Vec<String>> {
        let row = |(name, c): (&String, &super::OfConstant)| {
            let (mean, sd) = (c.mean.text(), c.sd.text());
            vec![name.clone(), mean, sd, c.b_basis.text(), c.a_basis.text()]
        };
        self.constants.iter().map(row).collect()
    }

    /// In words.
    pub fn text(&self) -> String {
        let count = self.specimens.len();
        let mut text = format!("{}: population of {count} specimens\n\n", self.name);
        let header = HEADER.map(String::from).to_vec();
        let rows: Vec<Vec<String>> = std::iter::once(header).chain(self.rows()).collect();
        let width = |k: usize| rows.iter().map(|r| r[k].len()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..HEADER.len()).map(width).collect();
        for row in &rows {
            let cells = row.iter().zip(&widths);
            let line: Vec<String> = cells.map(|(cell, w)| format!("{cell:w$}")).collect();
            text += &format!("  {}\n", line.join("   ").trim_end());
        }
        text += &format!("\n{}\n", self.convergence);
        for (name, reason) in &self.left_out {
            text += &format!("not among the specimens: {name} ({reason})\n");
        }
        for warning in &self.warnings {
            text += &format!("note: {warning}\n");
        }
        text
    }

    fn page(&self) -> String {
        self.ascii_page().replace(" +- ", " \u{b1} ")
    }

    fn ascii_page(&self) -> String {
        let count = self.specimens.len();
        let mut header = vec!["specimen".to_string()];
        for name in self.constants.keys() {
            header.extend([format!("{name} alone"), format!("{name} given all")]);
        }
        let specimens = self.specimens.iter().map(|(name, s)| {
            let mut row = vec![name.clone()];
            for (constant, [mean, sd]) in &s.alone {
                row.push(format!(
                    "{} +- {}",
                    significant(*mean, *sd),
                    significant(*sd, *sd)
                ));
                row.push(
                    s.shrunken
                        .get(constant)
                        .map(Estimate::text)
                        .unwrap_or_default(),
                );
            }
            row
        });
        let correlations = self.correlations.iter();
        let correlations = correlations.map(|(name, r)| vec![name.clone(), r.text()]);
        let body = html! {
            header {
                h1 { "Population of " (self.name) }
                p.soft { (count) " specimens; " (self.convergence) }
            }
            main {
                section {
                    h2 { "Constants" }
                    (table("Mean \u{b1} sd [95 % interval] of the population's mean and of the sd between specimens; basis values", &HEADER, self.rows(), false))
                    p.soft {
                        "B-basis: with 95 % confidence nine of ten specimens lie above it; A-basis: 99 of 100. Both are the 5 % quantile of the percentile's posterior, for a normal population."
                    }
                }
                section {
                    h2 { "Correlations between specimens" }
                    (table("Mean \u{b1} sd [95 % interval]", &["pair", "correlation"], correlations, false))
                }
                section {
                    h2 { "Specimens" }
                    (table("Alone, without the prior, and given all specimens", &header, specimens, true))
                }
                section {
                    h2 { "Notes" }
                    ul {
                        @for (name, reason) in &self.left_out { li { (name) " is not among the specimens: " (reason) } }
                        @for warning in &self.warnings { li { (warning) } }
                    }
                }
            }
            footer.soft { "Chains: chain.zarr and chain.csv; numbers: population.json." }
        };
        document(&format!("{}: population", self.name), &body)
    }
}

const HEADER: [&str; 5] = [
    "constant",
    "mean of the population",
    "sd between specimens",
    "B-basis",
    "A-basis",
];
