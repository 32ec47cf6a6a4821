//! What was found of one plate: its peaks, its modes, and what may disturb them.

use std::fmt::Write;

use serde::Serialize;

use super::super::{ExperimentSection, SectionMap, Undeclared, undeclared_table};
use super::found::{ModeFound, PeakFound, PlateFound};
use crate::error::{Error, Result};
use crate::section::{Piece, Table, TableCell, row};

/// An experiment's peaks and modes.
#[derive(Debug, Serialize)]
pub struct PlateReport<'a> {
    pub name: &'a str,
    pub peaks: Vec<PeakReport>,
    pub modes: &'a [ModeFound],
    /// What may act in the test that nobody declared.
    pub disturbances: &'a [Undeclared],
}

#[derive(Debug, Serialize)]
pub struct PeakReport {
    #[serde(rename = "measured_Hz")]
    pub measured_hz: f64,
    /// Half-waves along length and width of the mode that it is; none where it is more probably no mode.
    pub mode: Option<[usize; 2]>,
    /// Of this, or of being no mode.
    pub probability: f64,
    #[serde(rename = "predicted_Hz")]
    pub predicted_hz: Option<f64>,
    #[serde(rename = "predicted_sd_Hz")]
    pub predicted_sd_hz: Option<f64>,
    /// Measured over predicted, less 1.
    pub off_percent: Option<f64>,
    /// Why it is no mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl<'a> PlateReport<'a> {
    fn new(found: &'a PlateFound) -> Self {
        let peaks = found.peaks.iter().map(|p| {
            let mode = p.mode.map(|k| &found.modes[k]);
            PeakReport {
                measured_hz: p.frequency_hz,
                mode: mode.map(|m| m.label),
                probability: p.probability,
                predicted_hz: mode.map(|m| m.mean_hz),
                predicted_sd_hz: mode.map(|m| m.sd_hz),
                off_percent: mode.map(|m| 100.0 * (p.frequency_hz / m.mean_hz - 1.0)),
                why: p.mode.is_none().then(|| why_no_mode(p, found)),
            }
        });
        Self {
            name: &found.name,
            peaks: peaks.collect(),
            modes: &found.modes,
            disturbances: &found.undeclared,
        }
    }

    fn peaks_table(&self) -> Table {
        let header = [
            "measured Hz",
            "mode",
            "probability",
            "predicted Hz",
            "off %",
        ];
        let rows = self.peaks.iter().map(|p| {
            let mode = p.mode.map_or("none".into(), |[m, n]| format!("({m}, {n})"));
            let predicted = p.predicted_hz.zip(p.predicted_sd_hz);
            let predicted = predicted.map_or(TableCell::Missing, |(f, sd)| {
                format!("{f:.2} +- {sd:.2}").into()
            });
            let cells = [
                mode.into(),
                TableCell::Probability(p.probability),
                predicted,
                TableCell::signed(p.off_percent, 2),
            ];
            row(format!("{:.2}", p.measured_hz), cells)
        });
        Table::new(format!("{}: peaks and modes", self.name), header, rows)
    }

    /// What is said of the peaks that fit no mode.
    fn additional(&self) -> Piece {
        let said = |p: &PeakReport| {
            let why = p.why.as_ref()?;
            Some(format!("{:.2} Hz fits no mode: {why}", p.measured_hz))
        };
        Piece::list(self.peaks.iter().filter_map(said))
    }

    /// Modes that more probably than not left no peak.
    fn missing(&self) -> Piece {
        let missing = self.modes.iter().filter(|m| m.missing > 0.5);
        let missing: Vec<String> = missing
            .map(|m| format!("({}, {}) at {:.1} Hz", m.label[0], m.label[1], m.mean_hz))
            .collect();
        Piece::Paragraph(match missing.is_empty() {
            true => String::new(),
            false => format!("modes without a peak: {}", missing.join(", ")),
        })
    }
}

/// Why a peak is none of the predicted modes: what the nearest are, and what has their peaks.
fn why_no_mode(peak: &PeakFound, found: &PlateFound) -> String {
    let off = |m: &ModeFound| 100.0 * (peak.frequency_hz / m.mean_hz - 1.0);
    let contradicts = |m: &ModeFound| m.parity.zip(peak.parity).is_some_and(|(a, b)| a != b);
    let near = |of_parity: bool| {
        let modes = found.modes.iter().enumerate();
        let modes = modes.filter(|(_, m)| contradicts(m) != of_parity);
        modes.min_by(|a, b| off(a.1).abs().total_cmp(&off(b.1).abs()))
    };
    let described = |(k, m): (usize, &ModeFound)| {
        let [a, b] = m.label;
        let owner = found.peaks.iter().find(|p| p.mode == Some(k));
        let owner = owner.map_or("has no peak".into(), |p| {
            format!("is the peak at {:.2} Hz", p.frequency_hz)
        });
        format!(
            "({a}, {b}) at {:.2} Hz, {:+.1} % off, {owner}",
            m.mean_hz,
            off(m)
        )
    };
    let Some((k, own)) = near(true) else {
        return "no mode of its parity is in the band".into();
    };
    let of_parity = if peak.parity.is_some() {
        " of its parity"
    } else {
        ""
    };
    let mut text = format!("the nearest{of_parity}, {}", described((k, own)));
    if let Some(other) = near(false).filter(|(_, m)| off(m).abs() < off(own).abs()) {
        let _ = write!(
            text,
            "; nearer, but of the other parity: {}",
            described(other)
        );
    }
    text
}

/// What a plate's peaks are, for a report.
///
/// # Errors
/// Of the program: numbers that JSON cannot hold.
pub fn section(found: &PlateFound, warnings: Vec<String>) -> Result<ExperimentSection> {
    let report = PlateReport::new(found);
    let pieces = vec![
        report.peaks_table().into(),
        report.additional(),
        report.missing(),
        undeclared_table(&found.undeclared).into(),
    ];
    let value = serde_json::to_value(&report)
        .map_err(|e| Error::program("report.json", "numbers that JSON can hold").found(e))?;
    Ok(ExperimentSection {
        name: found.name.clone(),
        pieces,
        warnings,
        value,
        maps: found.modes.iter().map(|mode| map(found, mode)).collect(),
    })
}

/// Deflection of a mode at the first draw.
fn map(found: &PlateFound, mode: &ModeFound) -> SectionMap {
    let is_own = |p: &&PeakFound| p.mode.is_some_and(|k| std::ptr::eq(&found.modes[k], mode));
    let peak = found.peaks.iter().find(is_own);
    let peak = peak.map_or("no peak".into(), |p| {
        format!("peak {:.1} Hz", p.frequency_hz)
    });
    let [m, n] = mode.label;
    SectionMap {
        name: format!("{}-{m}-{n}", found.name),
        title: format!("({m}, {n}) at {:.1} Hz, {peak}", mode.mean_hz),
        grid: found.grid,
        size_mm: found.size_mm,
        values: mode.shape.clone(),
    }
}
