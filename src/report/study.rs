//! What experiments said of which none is a field: `report.json`, the terminal, and the page.

use std::fmt::Write;
use std::path::Path;

use indexmap::IndexMap;
use maud::html;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::figures::{Figure, FigureData, Palette, Picture, Scale, posterior_corner};
use super::html;
use super::json::{Keyed, read};
use super::manifest::KnownTruth;
use super::round::{MeanAndSd, beside_published};
use super::terminal::table;
use super::together::{TogetherReport, section_html, section_text};
use crate::chain::Draws;
use crate::error::Result;
use crate::files;
use crate::quantity::significant;
use crate::study::{ExperimentSection, SampledStudy, SectionMap, Study};

/// The schema of `report.json` of a study without a field.
pub const SCHEMA: &str = "plychain-frequencies/1";

/// `report.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct StudyReport {
    pub schema: String,
    pub model: String,
    pub posterior: IndexMap<String, ParameterFound>,
    pub converged: bool,
    pub convergence: String,
    /// Draws of second-order frequencies weighed by exact ones.
    pub exact: ExactReport,
    pub experiments: Vec<Value>,
    /// The experiments beside each other, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub together: Option<TogetherReport>,
    #[serde(skip)]
    pub sections: Vec<ExperimentSection>,
    pub warnings: Vec<String>,
}

/// A parameter, in the unit of its name.
#[derive(Debug, Serialize, Deserialize)]
pub struct ParameterFound {
    pub mean: f64,
    pub sd: f64,
    pub low: f64,
    pub median: f64,
    pub high: f64,
    pub rhat: f64,
    pub ess_bulk: f64,
    /// Posterior over prior variance, what the peaks leave of it; of constants alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variance_left: Option<f64>,
    /// What the model says that others found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<MeanAndSd>,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct ExactReport {
    pub draws: usize,
    /// Effective draws over draws.
    pub effective: f64,
    /// Largest shift of a parameter's mean, posterior sds.
    pub shift_sd: f64,
}

impl StudyReport {
    pub fn new(study: &Study, sampled: &SampledStudy, together: Option<TogetherReport>) -> Self {
        let priors = study.shared().constants;
        let rows = sampled.verdict.rows.iter().map(|row| {
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
                published: MeanAndSd::published(&study.outline.material, &row.name),
            };
            (row.name.clone(), found)
        });
        Self {
            schema: SCHEMA.into(),
            model: study.name().into(),
            posterior: rows.collect(),
            converged: sampled.verdict.converged,
            convergence: sampled.verdict.line(),
            exact: ExactReport {
                draws: sampled.exact.draws,
                effective: sampled.exact.effective,
                shift_sd: sampled.exact.shift_sd,
            },
            experiments: sampled.sections.iter().map(|s| s.value.clone()).collect(),
            together,
            sections: sampled.sections.clone(),
            warnings: sampled.warnings.clone(),
        }
    }

    /// The report in the folder of a finished run, without sections.
    ///
    /// # Errors
    /// The input's fault, with the file and the key.
    pub fn load(folder: &Path) -> Result<Self> {
        let (file, text) = read(folder, "report.json")?;
        files::parse_json(&text, &file)
    }

    /// Whether a folder's report is of this schema.
    pub fn is_in(folder: &Path) -> bool {
        let text = std::fs::read_to_string(folder.join("report.json")).unwrap_or_default();
        let report: Value = serde_json::from_str(&text).unwrap_or_default();
        report["schema"] == SCHEMA
    }

    /// The constants by all experiments.
    fn all(&self) -> Keyed<MeanAndSd> {
        let constants = self
            .posterior
            .iter()
            .filter(|p| p.1.variance_left.is_some());
        let moments = |(name, p): (&String, &ParameterFound)| {
            let found = MeanAndSd {
                mean: p.mean,
                sd: p.sd,
            };
            (name.clone(), found)
        };
        constants.map(moments).collect()
    }

    /// For the terminal.
    pub fn text(&self) -> String {
        let mut text = format!("\n{}: posterior\n\n", self.model);
        let (header, rows) = self.posterior_table();
        text += &table(&header, rows);
        text += &self.sections.iter().map(section_text).collect::<String>();
        if let Some(together) = &self.together {
            let bare = TogetherReport {
                sections: Vec::new(),
                warnings: Vec::new(),
                ..together.clone()
            };
            text += &bare.text(&self.all());
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
pub fn page(report: &StudyReport, draws: &Draws, truth: Option<&KnownTruth>) -> Result<String> {
    let names: Vec<String> = report.posterior.keys().cloned().collect();
    let corner = posterior_corner(&FigureData::quoted(draws, &names, truth))?;
    let mut sections = Vec::new();
    for section in &report.sections {
        let figures: Vec<Figure> = section.maps.iter().map(figure).collect::<Result<_>>()?;
        sections.push((section, figures));
    }
    let body = html! {
        header {
            h1 { (report.model) }
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
            @if let Some(together) = &report.together {
                section id="together" {
                    h2 { "All experiments" }
                    (together.section(&report.all()))
                }
            }
            @for (own, figures) in &sections {
                section id=(own.name) {
                    h2 { (own.name) }
                    (section_html(own))
                    @if !figures.is_empty() {
                        h3 { "Mode shapes" }
                        p.soft { "Deflection over the plate at the first draw, length to the right; (m, n): half-waves along length and width." }
                        div.maps { @for figure in figures { (html::figure(figure)) } }
                    }
                }
            }
        }
        footer.soft { "Modes and peaks are compared over all assignments; the probabilities are those of the posterior." }
    };
    Ok(html::document(
        &format!("{}: plychain report", report.model),
        &body,
    ))
}

fn figure(map: &SectionMap) -> Result<Figure> {
    let [columns, lines] = map.grid;
    let [length, width] = map.size_mm;
    let point = |row: usize, col: usize| {
        let middle = |k: usize, n: usize, side: f64| side * (k as f64 + 0.5) / n as f64;
        [middle(col, columns, length), middle(row, lines, width)]
    };
    let picture = Picture {
        name: map.name.clone(),
        title: map.title.clone(),
        size: [lines, columns],
        point: &point,
        value: &|row, col| map.values[row * columns + col],
        scale: Scale {
            palette: Palette::Difference,
            range: [-1.0, 1.0],
            unit: "",
        },
        middle: false,
    };
    picture.draw()
}
