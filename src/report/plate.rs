//! What was found of one plate: its peaks, its modes, and what may disturb them.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::section::{Piece, Table, TableCell, row};
use crate::experiment::frequencies::Parity;
use crate::identify::{ModeFound, PeakFound, PlateFound};
use crate::infer::Disturbed;

/// An experiment's peaks and modes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlateReport {
    pub name: String,
    pub peaks: Vec<PeakReport>,
    pub modes: Vec<ModeReport>,
    /// What may act in the test that nobody declared.
    pub disturbances: Vec<DisturbanceReport>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DisturbanceReport {
    pub name: String,
    pub parameter: String,
    /// Prior sd, in the parameter's unit.
    pub plausible: f64,
    pub log_bayes_factor: f64,
    /// If it acts, with an sd.
    pub amplitude: [f64; 2],
    /// What it does to the constants at its plausible size, undeclared, in their order; prior sds.
    pub shift_in_prior_sd: Vec<f64>,
    pub confirm: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModeReport {
    pub mode: [usize; 2],
    pub parity: Option<Parity>,
    #[serde(rename = "predicted_Hz")]
    pub predicted_hz: f64,
    #[serde(rename = "predicted_sd_Hz")]
    pub predicted_sd_hz: f64,
    /// Probability that it left no peak.
    pub missing: f64,
}

impl DisturbanceReport {
    fn new(found: &Disturbed) -> Self {
        Self {
            name: found.name.into(),
            parameter: found.parameter.into(),
            plausible: found.plausible,
            log_bayes_factor: found.log_bayes_factor,
            amplitude: found.amplitude,
            shift_in_prior_sd: found.shift_sds.clone(),
            confirm: found.confirm.into(),
        }
    }
}

impl PlateReport {
    pub(super) fn new(found: &PlateFound) -> Self {
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
        let modes = found.modes.iter().map(|m| ModeReport {
            mode: m.label,
            parity: m
                .odd
                .map(|odd| if odd { Parity::Odd } else { Parity::Even }),
            predicted_hz: m.mean_hz,
            predicted_sd_hz: m.sd_hz,
            missing: m.missing,
        });
        Self {
            name: found.name.clone(),
            peaks: peaks.collect(),
            modes: modes.collect(),
            disturbances: found.disturbed.iter().map(DisturbanceReport::new).collect(),
        }
    }

    pub(super) fn disturbances_table(&self) -> Table {
        let header = [
            "disturbance",
            "unit",
            "plausible",
            "log Bayes factor",
            "amplitude if it acts",
            "moves the constants by, prior sd",
        ];
        let rows = self.disturbances.iter().map(|d| {
            let shifts = d.shift_in_prior_sd.iter().map(|s| format!("{s:+.2}"));
            let cells = [
                TableCell::from(&d.parameter),
                TableCell::three(d.plausible),
                TableCell::signed(d.log_bayes_factor, 1),
                TableCell::mean_sd(Some(d.amplitude.into())),
                shifts.collect::<Vec<_>>().join(" ").into(),
            ];
            row(&d.name, cells)
        });
        Table::new("what may act that nobody declared", header, rows)
    }

    pub(super) fn peaks_table(&self) -> Table {
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
    pub(super) fn additional(&self) -> Piece {
        let said = |p: &PeakReport| {
            let why = p.why.as_ref()?;
            Some(format!("{:.2} Hz fits no mode: {why}", p.measured_hz))
        };
        Piece::list(self.peaks.iter().filter_map(said))
    }

    /// Peaks, modes, and what may act.
    pub(super) fn pieces(&self) -> [Piece; 4] {
        // more probably than not they left no peak
        let missing = self.modes.iter().filter(|m| m.missing > 0.5);
        let missing: Vec<String> = missing
            .map(|m| format!("({}, {}) at {:.1} Hz", m.mode[0], m.mode[1], m.predicted_hz))
            .collect();
        let missing = match missing.is_empty() {
            true => String::new(),
            false => format!("modes without a peak: {}", missing.join(", ")),
        };
        [
            self.peaks_table().into(),
            self.additional(),
            Piece::Paragraph(missing),
            self.disturbances_table().into(),
        ]
    }
}

/// Why a peak is none of the predicted modes: what the nearest are, and what has their peaks.
fn why_no_mode(peak: &PeakFound, found: &PlateFound) -> String {
    let off = |m: &ModeFound| 100.0 * (peak.frequency_hz / m.mean_hz - 1.0);
    let contradicts = |m: &ModeFound| m.odd.zip(peak.odd).is_some_and(|(a, b)| a != b);
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
    let of_parity = if peak.odd.is_some() {
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
