//! What experiments said of which none is a field: `report.json`, the terminal, and the page.

use std::path::Path;

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_with::skip_serializing_none;

use super::figures::{Figure, Palette, PixelPicture, Scale, posterior_corner};
use super::html::html;
use super::json::{Keyed, Versioned, load};
use super::learned::{Learned, not_measured};
use super::manifest::KnownTruth;
use super::numbers::FigureData;
use super::round::MeanAndSd;
use super::run::posterior::{MarginalRow, marginals};
use super::together::{TogetherReport, experiment_section};
use crate::chain::Draws;
use crate::error::Result;
use crate::section::{Document, Piece, Section, Table};
use crate::study::{Exact, ExperimentSection, SampledStudy, SectionMap, Study};

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
    pub exact: Exact,
    pub experiments: Vec<Value>,
    /// The experiments beside each other, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub together: Option<TogetherReport>,
    #[serde(skip)]
    pub sections: Vec<ExperimentSection>,
    pub warnings: Vec<String>,
}

/// A parameter, in the unit of its name.
#[skip_serializing_none]
#[derive(Debug, Serialize, Deserialize)]
pub struct ParameterFound {
    pub mean: f64,
    pub sd: f64,
    pub low: f64,
    pub median: f64,
    pub high: f64,
    pub rhat: f64,
    pub ess_bulk: f64,
    /// Posterior over prior variance, what the data leave of it; of constants alone.
    pub variance_left: Option<f64>,
    /// What the data added to the prior; of constants alone.
    pub learned: Option<Learned>,
    /// What the model says that others found.
    pub published: Option<MeanAndSd>,
}

impl StudyReport {
    pub fn new(study: &Study, sampled: &SampledStudy, together: Option<TogetherReport>) -> Self {
        let priors = study.shared().constants;
        let rows = sampled.verdict.rows.iter().map(|row| {
            let prior = priors.iter().find(|p| p.0 == row.name);
            let own = (row.mean, row.sd).into();
            let learned = prior.map(|p| Learned::new((p.1.mean, p.1.sd).into(), own));
            let found = ParameterFound {
                mean: row.mean,
                sd: row.sd,
                low: row.low,
                median: row.median,
                high: row.high,
                rhat: row.rhat,
                ess_bulk: row.ess_bulk,
                variance_left: prior.map(|p| (row.sd / p.1.sd).powi(2)),
                learned,
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
            exact: sampled.exact,
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
        load(folder, "report.json")
    }

    /// Whether a folder's report is of this schema.
    pub fn is_in(folder: &Path) -> bool {
        let report = load::<Versioned>(folder, "report.json");
        report.is_ok_and(|r| r.schema == SCHEMA)
    }

    /// The constants by all experiments.
    fn all(&self) -> Keyed<MeanAndSd> {
        let constants = self
            .posterior
            .iter()
            .filter(|p| p.1.variance_left.is_some());
        constants
            .map(|(n, p)| (n.clone(), (p.mean, p.sd).into()))
            .collect()
    }

    /// For the terminal.
    pub fn sections(&self) -> Vec<Section> {
        let posterior = Section::new(format!("{}: posterior", self.model)).with(self.posterior());
        let experiments = self.sections.iter().map(experiment_section);
        let exact = format!(
            "Checked with the exact likelihood at {} draws: the means move by {:.3} sd at most, and {:.0} % of the draws are effective.",
            self.exact.draws,
            self.exact.shift_sd,
            100.0 * self.exact.effective
        );
        let end = Section::default().say(exact).with_all(self.remarks());
        std::iter::once(posterior)
            .chain(experiments)
            .chain(self.together())
            .chain([end])
            .collect()
    }

    /// The constants by each experiment, where there are several.
    fn together(&self) -> Option<Section> {
        let bare = TogetherReport {
            sections: Vec::new(),
            warnings: Vec::new(),
            ..self.together.clone()?
        };
        Some(bare.section(&self.all()))
    }

    /// Whether the numbers can be used.
    fn remarks(&self) -> [Piece; 3] {
        [
            Piece::Paragraph(self.convergence.clone()),
            Piece::Paragraph(self.weak().unwrap_or_default()),
            Piece::Warnings(self.warnings.clone()),
        ]
    }

    /// Constants of which the data say little.
    fn weak(&self) -> Option<String> {
        let constants = self.posterior.iter();
        let learned = constants.filter_map(|(name, p)| Some((name.clone(), p.learned?)));
        not_measured(&learned.collect())
    }

    fn posterior(&self) -> Table {
        let rows = self.posterior.iter().map(|(name, r)| MarginalRow {
            name,
            found: (r.mean, r.sd).into(),
            quantiles: [r.low, r.median, r.high],
            rhat: r.rhat,
            ess_bulk: r.ess_bulk,
            learned: r.learned,
            published: r.published,
        });
        marginals("", rows)
    }
}

/// The page.
///
/// # Errors
/// The program's fault if a figure cannot be drawn.
pub fn page(report: &StudyReport, draws: &Draws, truth: &KnownTruth) -> Result<String> {
    let names: Vec<String> = report.posterior.keys().cloned().collect();
    let corner = posterior_corner(&FigureData::quoted(draws, &names, truth))?;
    let mut figures: Vec<Figure> = corner.into_iter().map(|f| f.called("corner")).collect();
    let posterior = Section::new("Posterior").with(report.posterior());
    let mut sections = vec![posterior.with(Piece::figure("corner"))];
    sections.extend(report.together());
    for own in &report.sections {
        let mut section = experiment_section(own);
        let maps = own
            .maps
            .iter()
            .map(figure)
            .collect::<Result<Vec<Figure>>>()?;
        if !maps.is_empty() {
            section.push(Piece::Gallery {
                heading: "mode shapes".into(),
                names: maps.iter().map(|f| f.name.clone()).collect(),
            });
            section.push(Piece::Note(
                "Deflection over the plate at the first draw, length to the right; (m, n): half-waves along length and width.".into(),
            ));
        }
        sections.push(section);
        figures.extend(maps);
    }
    let version = Piece::Note(format!("plychain {}", env!("CARGO_PKG_VERSION")));
    let document = Document {
        title: format!("{}: plychain report", report.model),
        heading: report.model.clone(),
        lead: std::iter::once(version).chain(report.remarks()).collect(),
        sections,
        folded: false,
        footer: "Modes and peaks are compared over all assignments; the probabilities are those of the posterior.".into(),
    };
    Ok(html(&document, &figures))
}

fn figure(map: &SectionMap) -> Result<Figure> {
    let [columns, lines] = map.grid;
    let [length, width] = map.size_mm;
    let point = |row: usize, col: usize| {
        let middle = |k: usize, n: usize, side: f64| side * (k as f64 + 0.5) / n as f64;
        [middle(col, columns, length), middle(row, lines, width)]
    };
    let picture = PixelPicture {
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
