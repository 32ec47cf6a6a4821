//! What the frequencies of plates said: `report.json`, the terminal, and the page.

use std::fmt::Write;

use indexmap::IndexMap;
use maud::html;
use serde::Serialize;

use super::figures::{Figure, FigureData, Palette, Picture, Scale, posterior_corner};
use super::html;
use super::manifest::KnownTruth;
use super::plate::{DISTURBANCES, PEAKS, PlateReport};
use super::round::{MeanAndSd, beside_published};
use super::terminal::table;
use crate::error::Result;
use crate::identify::{FrequenciesFound, PlateFound};
use crate::infer::FrequenciesModel;
use crate::quantity::significant;

/// The schema of `report.json` of a model of plates.
pub const SCHEMA: &str = "plychain-frequencies/1";

/// `report.json`.
#[derive(Debug, Serialize)]
pub struct FrequenciesReport {
    pub schema: &'static str,
    pub model: String,
    pub posterior: IndexMap<String, ParameterFound>,
    pub converged: bool,
    pub convergence: String,
    /// Draws of second-order frequencies weighed by exact ones.
    pub exact: ExactReport,
    pub experiments: Vec<PlateReport>,
    pub warnings: Vec<String>,
}

/// A parameter, in the unit of its name.
#[derive(Debug, Serialize)]
pub struct ParameterFound {
    pub mean: f64,
    pub sd: f64,
    pub low: f64,
    pub median: f64,
    pub high: f64,
    pub rhat: f64,
    pub ess_bulk: f64,
    /// Posterior over prior variance, what the peaks leave of it; of constants alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance_left: Option<f64>,
    /// What the model says that others found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub published: Option<MeanAndSd>,
}

#[derive(Debug, Serialize)]
pub struct ExactReport {
    pub draws: usize,
    /// Effective draws over draws.
    pub effective: f64,
    /// Largest shift of a parameter's mean, posterior sds.
    pub shift_sd: f64,
}

impl FrequenciesReport {
    pub fn new(model: &FrequenciesModel, found: &FrequenciesFound) -> Self {
        let priors = model.constants();
        let rows = found.verdict.rows.iter().map(|row| {
            let prior = priors.iter().find(|p| p.0 == row.name);
            let found = ParameterFound {
                mean: row.mean,
                sd: row.sd,
                low: row.low,
                median: row.median,
                high: row.high,
                rhat: row.rhat,
                ess_bulk: row.ess_bulk,
                variance_left: prior.map(|p| (row.sd / p.1.sd).powi(2)),
                published: MeanAndSd::published(&model.file.material, &row.name),
            };
            (row.name.clone(), found)
        });
        Self {
            schema: SCHEMA,
            model: model.file.name.clone(),
            posterior: rows.collect(),
            converged: found.verdict.converged,
            convergence: found.verdict.line(),
            exact: ExactReport {
                draws: found.exact.draws,
                effective: found.exact.effective,
                shift_sd: found.exact.shift_sd,
            },
            experiments: found.plates.iter().map(PlateReport::new).collect(),
            warnings: found.warnings.clone(),
        }
    }

    /// For the terminal.
    pub fn text(&self) -> String {
        let mut text = format!("\n{}: posterior\n\n", self.model);
        let (header, rows) = self.posterior_table();
        text += &table(&header, rows);
        for experiment in &self.experiments {
            let _ = writeln!(text, "\n{}\n", experiment.name);
            text += &table(&PEAKS, experiment.peak_rows());
            for said in experiment.additional() {
                let _ = writeln!(text, "  {said}");
            }
            let missing = experiment.missing();
            if !missing.is_empty() {
                let _ = writeln!(text, "\n  modes without a peak: {}", missing.join(", "));
            }
            let _ = writeln!(text, "\nwhat may act that nobody declared\n");
            text += &table(&DISTURBANCES, experiment.disturbance_rows());
        }
        let _ = writeln!(
            text,
            "\nby exact frequencies at {} draws: means move by {:.3} sd at most, {:.0} % of the draws are effective",
            self.exact.draws,
            self.exact.shift_sd,
            100.0 * self.exact.effective
        );
        let _ = writeln!(text, "{}", self.convergence);
        if let Some(weak) = self.weak() {
            let _ = writeln!(text, "{weak}");
        }
        if !self.warnings.is_empty() {
            text += "\nBEFORE YOU USE THESE NUMBERS\n";
            for warning in &self.warnings {
                let _ = writeln!(text, "  - {warning}");
            }
        }
        text
    }

    fn posterior_table(&self) -> (Vec<&'static str>, Vec<Vec<String>>) {
        let row = |(name, r): (&String, &ParameterFound)| {
            let numbers = [r.mean, r.sd].map(|v| significant(v, r.sd));
            let ends = [r.low, r.high].map(|v| significant(v, r.sd));
            let cov = format!("{:.2}", 100.0 * r.sd / r.mean.abs());
            let worth = [format!("{:.4}", r.rhat), format!("{:.0}", r.ess_bulk)];
            let cells = std::iter::once(name.clone())
                .chain(numbers)
                .chain([cov])
                .chain(ends)
                .chain(worth);
            (cells.collect(), r.published)
        };
        beside_published(POSTERIOR, self.posterior.iter().map(row))
    }

    /// Constants of which the peaks say little.
    fn weak(&self) -> Option<String> {
        /// Share of the prior variance that is left.
        const LITTLE: f64 = 0.5;
        let weak: Vec<&str> = self
            .posterior
            .iter()
            .filter(|(_, p)| p.variance_left.is_some_and(|v| v > LITTLE))
            .map(|(name, _)| name.as_str())
            .collect();
        (!weak.is_empty())
            .then(|| format!("mostly the prior's, hardly measured: {}", weak.join(", ")))
    }
}

const POSTERIOR: [&str; 8] = ["", "mean", "sd", "COV %", "2.5 %", "97.5 %", "R-hat", "ESS"];
/// The page.
///
/// # Errors
/// The program's fault if a figure cannot be drawn.
pub fn page(
    report: &FrequenciesReport,
    found: &FrequenciesFound,
    truth: Option<&KnownTruth>,
) -> Result<String> {
    let names: Vec<String> = report.posterior.keys().cloned().collect();
    let corner = posterior_corner(&FigureData::quoted(&found.draws, &names, truth))?;
    let mut plates = Vec::new();
    for (own, plate) in report.experiments.iter().zip(&found.plates) {
        plates.push((own, shapes(plate)?));
    }
    let body = html! {
        header {
            h1 { (report.model) ": natural frequencies" }
            p.soft { "plychain " (env!("CARGO_PKG_VERSION")) }
            p { (report.convergence) }
            @if let Some(weak) = report.weak() { p { (weak) } }
            @for warning in &report.warnings { p { b { "Before you use these numbers: " } (warning) } }
        }
        main {
            section id="posterior" {
                h2 { "Posterior" }
                @let (header, rows) = report.posterior_table();
                (html::rows_of(&header, &rows))
                @if let Some(figure) = &corner { (html::figure(figure)) }
            }
            @for (own, figures) in &plates {
                section id=(own.name) {
                    h2 { (own.name) ": peaks and modes" }
                    (html::rows_of(&PEAKS, &own.peak_rows()))
                    @for said in own.additional() { p { (said) "." } }
                    h3 { "What may act that nobody declared" }
                    (html::rows_of(&DISTURBANCES, &own.disturbance_rows()))
                    @if !own.missing().is_empty() { p { "Modes without a peak: " (own.missing().join(", ")) "." } }
                    h3 { "Mode shapes" }
                    p.soft { "Deflection over the plate at the first draw, length to the right; (m, n): half-waves along length and width." }
                    div.maps { @for figure in figures { (html::figure(figure)) } }
                }
            }
        }
        footer.soft { "Modes and peaks are compared over all assignments; the probabilities are those of the posterior." }
    };
    Ok(html::document(
        &format!("{}: plychain frequencies", report.model),
        &body,
    ))
}

fn shapes(plate: &PlateFound) -> Result<Vec<Figure>> {
    let [columns, lines] = plate.grid;
    let [length, width] = plate.size_mm;
    let point = |row: usize, col: usize| {
        let at = |k: usize, n: usize, side: f64| side * (k as f64 + 0.5) / n as f64;
        [at(col, columns, length), at(row, lines, width)]
    };
    let figures = plate.modes.iter().map(|mode| {
        let peak = plate
            .peaks
            .iter()
            .find(|p| p.mode.is_some_and(|k| std::ptr::eq(&plate.modes[k], mode)));
        let seen = peak.map_or("no peak".into(), |p| {
            format!("peak {:.1} Hz", p.frequency_hz)
        });
        let [m, n] = mode.label;
        let picture = Picture {
            name: format!("{}-{m}-{n}", plate.name),
            title: format!("({m}, {n}) at {:.1} Hz, {seen}", mode.mean_hz),
            size: [lines, columns],
            point: &point,
            value: &|row, col| mode.shape[row * columns + col],
            scale: Scale {
                palette: Palette::Difference,
                range: [-1.0, 1.0],
                unit: "",
            },
            middle: false,
        };
        picture.draw()
    });
    figures.collect()
}
