//! What the frequencies of plates said: `report.json`, the terminal, and the page.

use indexmap::IndexMap;
use serde::Serialize;

use super::figures::{Figure, Palette, PixelPicture, Scale, posterior_corner};
use super::manifest::KnownTruth;
use super::numbers::FigureData;
use super::plate::PlateReport;
use super::round::MeanAndSd;
use super::section::{Document, Piece, Section, Table, TableCell, html, row};
use crate::error::Result;
use crate::identify::{FrequenciesFound, PlateFound};
use crate::infer::FrequenciesModel;

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
    pub fn sections(&self) -> Vec<Section> {
        let posterior = Section::new(format!("{}: posterior", self.model)).with(self.posterior());
        let plates = self.experiments.iter();
        let plates = plates.map(|plate| Section::new(&plate.name).with_all(plate.pieces()));
        let exact = format!(
            "by exact frequencies at {} draws: means move by {:.3} sd at most, {:.0} % of the draws are effective",
            self.exact.draws,
            self.exact.shift_sd,
            100.0 * self.exact.effective
        );
        let end = Section::default().say(exact).with_all(self.remarks());
        std::iter::once(posterior)
            .chain(plates)
            .chain([end])
            .collect()
    }

    /// Whether the numbers can be used.
    fn remarks(&self) -> [Piece; 3] {
        [
            Piece::Paragraph(self.convergence.clone()),
            Piece::Paragraph(self.weak().unwrap_or_default()),
            Piece::Warnings(self.warnings.clone()),
        ]
    }

    fn posterior(&self) -> Table {
        let header = [
            "",
            "mean",
            "sd",
            "COV %",
            "2.5 %",
            "97.5 %",
            "R-hat",
            "ESS",
            "published",
        ];
        let rows = self.posterior.iter().map(|(name, r)| {
            let [mean, sd, low, high] =
                TableCell::as_precise_as(r.sd, [r.mean, r.sd, r.low, r.high]);
            let cells = [
                mean,
                sd,
                TableCell::fixed(100.0 * r.sd / r.mean.abs(), 2),
                low,
                high,
                TableCell::fixed(r.rhat, 4),
                TableCell::fixed(r.ess_bulk, 0),
                TableCell::published(r.published.map(|p| (p.mean, p.sd))),
            ];
            row(name, cells)
        });
        Table::new("", header, rows)
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
    let mut figures: Vec<Figure> = corner.into_iter().map(|f| f.called("corner")).collect();
    let posterior = Section::new("Posterior").with(report.posterior());
    let mut sections = vec![posterior.with(Piece::figure("corner"))];
    for (said, plate) in report.experiments.iter().zip(&found.plates) {
        let shapes = shapes(plate)?;
        let section = Section::new(format!("{}: peaks and modes", said.name));
        let section = section.with_all(said.pieces()).with(Piece::Gallery {
            heading: "mode shapes".into(),
            names: shapes.iter().map(|f| f.name.clone()).collect(),
        });
        sections.push(section.with(Piece::Note(
            "Deflection over the plate at the first draw, length to the right; (m, n): half-waves along length and width.".into(),
        )));
        figures.extend(shapes);
    }
    let version = Piece::Note(format!("plychain {}", env!("CARGO_PKG_VERSION")));
    let document = Document {
        title: format!("{}: plychain frequencies", report.model),
        heading: format!("{}: natural frequencies", report.model),
        lead: std::iter::once(version).chain(report.remarks()).collect(),
        sections,
        footer: "Modes and peaks are compared over all assignments; the probabilities are those of the posterior.".into(),
    };
    Ok(html(&document, &figures))
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
        let picture = PixelPicture {
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
