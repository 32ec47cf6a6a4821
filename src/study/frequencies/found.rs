//! What each peak is, over the draws of a posterior.

use serde::Serialize;

use super::super::together::some;
use super::super::{Undeclared, WORTH};
use super::peaks::{MODEL_ERROR, Peaks};
use crate::chain::Draws;
use crate::diagnose::sorted;
use crate::error::{Error, Result};
use crate::experiment::frequencies::{Parity, Ritz, VibrationMode};
use crate::numeric::quantile;
use crate::quantity::plus_minus;

/// What an experiment's peaks are.
pub struct PlateFound {
    pub name: String,
    pub peaks: Vec<PeakFound>,
    /// Predicted modes within the band, by frequency.
    pub modes: Vec<ModeFound>,
    /// Deflections of the modes on a grid of this many points along length and width.
    pub grid: [usize; 2],
    pub size_mm: [f64; 2],
    /// What may act that nobody declared.
    pub undeclared: Vec<Undeclared>,
}

/// A measured peak.
pub struct PeakFound {
    pub frequency_hz: f64,
    /// Its measured parity, where that is known.
    pub parity: Option<Parity>,
    /// Index of the mode that it is most probably, and how probably; none where it is more probably no mode.
    pub mode: Option<usize>,
    pub probability: f64,
}

/// A mode.
#[derive(Debug, Serialize)]
pub struct ModeFound {
    /// Numbers of half-waves along length and width.
    #[serde(rename = "mode")]
    pub label: [usize; 2],
    pub parity: Option<Parity>,
    /// Over the posterior.
    #[serde(rename = "predicted_Hz")]
    pub mean_hz: f64,
    #[serde(rename = "predicted_sd_Hz")]
    pub sd_hz: f64,
    /// Probability that it left no peak.
    pub missing: f64,
    /// Deflection, 1 at most, row by row from low y.
    #[serde(skip)]
    pub shape: Vec<f64>,
}

/// Draws over which peaks are assigned.
const DRAWS: usize = 200;
/// Deflections along the longer side.
const SHAPE: usize = 61;
/// Evidence over that of the best top, logarithm, from which another assignment is worth a warning.
const RIVAL: f64 = -4.6;

/// Peaks and modes over the draws of a plate's own parameters.
///
/// # Errors
/// Of the program: draws that no plate has.
pub fn found(plate: &Peaks, draws: &Draws) -> Result<PlateFound> {
    let points = some(draws, DRAWS);
    let seen: Vec<_> = points.filter_map(|x| plate.seen(x)).collect();
    let mean: Vec<f64> = (0..draws.dim())
        .map(|k| crate::diagnose::mean(&draws.series(k).values))
        .collect();
    let Some(first) = seen.first() else {
        return Err(Error::program("frequencies", "draws that some plate has"));
    };
    let band = plate.spec.peak_model(0.01).band_hz;
    let mut modes: Vec<(ModeFound, Vec<f64>)> = Vec::new();
    let side = [
        plate.spec.specimen.length_mm.mean,
        plate.spec.specimen.width_mm.mean,
    ];
    let grid = grid(side);
    for mode in &first.modes {
        let own: Vec<(f64, f64, Vec<f64>)> = seen
            .iter()
            .filter_map(|s| {
                let j = s.modes.iter().position(|m| m.is(mode))?;
                let matched = s.assigned.matched.row(j).iter().copied().collect();
                Some((s.modes[j].frequency_hz(), s.assigned.missing(j), matched))
            })
            .collect();
        let n = own.len() as f64;
        let mean_hz = own.iter().map(|o| o.0).sum::<f64>() / n;
        let variance = own.iter().map(|o| (o.0 - mean_hz).powi(2)).sum::<f64>() / n;
        let of_peak = |i: usize| own.iter().map(|o| o.2[i]).sum::<f64>() / seen.len() as f64;
        let matched: Vec<f64> = (0..plate.spec.frequencies_hz.len()).map(of_peak).collect();
        let likely = matched.iter().copied().fold(0.0, f64::max);
        if (band[0]..=band[1]).contains(&mean_hz) || likely > 0.5 {
            let found = ModeFound {
                label: plate.ritz().label(mode),
                parity: mode.odd.map(Parity::of),
                mean_hz,
                sd_hz: variance.sqrt(),
                missing: own.iter().map(|o| o.1).sum::<f64>() / n,
                shape: shape(plate.ritz(), mode, grid),
            };
            modes.push((found, matched));
        }
    }
    modes.sort_by(|a, b| a.0.mean_hz.total_cmp(&b.0.mean_hz));
    let peaks = plate.spec.peaks().into_iter().enumerate();
    let peaks = peaks
        .map(|(i, peak)| {
            let best = modes
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.1[i].total_cmp(&b.1.1[i]));
            let no_mode = (1.0 - modes.iter().map(|m| m.1[i]).sum::<f64>()).clamp(0.0, 1.0);
            let best = best.filter(|(_, m)| m.1[i] > no_mode);
            PeakFound {
                frequency_hz: peak.frequency_hz,
                parity: peak.odd.map(Parity::of),
                mode: best.map(|(k, _)| k),
                probability: best.map_or(no_mode, |(_, m)| m.1[i]),
            }
        })
        .collect();
    Ok(PlateFound {
        name: plate.spec.name.clone(),
        peaks,
        modes: modes.into_iter().map(|m| m.0).collect(),
        grid,
        size_mm: side,
        undeclared: plate.disturbed(&mean),
    })
}

fn grid([length, width]: [f64; 2]) -> [usize; 2] {
    let longest = length.max(width);
    [length, width].map(|side| ((SHAPE as f64 * side / longest).round() as usize).max(8))
}

/// The deflection, 1 at most.
fn shape(ritz: &Ritz, mode: &VibrationMode, [columns, rows]: [usize; 2]) -> Vec<f64> {
    let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let points: Vec<[f64; 2]> = (0..rows)
        .flat_map(|r| (0..columns).map(move |c| [at(c, columns), at(r, rows)]))
        .collect();
    let w = ritz.deflection(mode, &points);
    let largest = w.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
    w.iter().map(|w| w / largest).collect()
}

/// Another assignment that is nearly as probable.
fn rivals(plate: &Peaks) -> Option<String> {
    let best = plate
        .tops
        .iter()
        .map(|t| t.log_evidence)
        .fold(f64::MIN, f64::max);
    let first = &plate.tops[0];
    let other = plate.tops.iter().skip(1).find(|t| {
        let near = t.log_evidence - best > RIVAL;
        near && (&t.place - &first.place).amax() > 1.0
    })?;
    let share = (other.log_evidence - best).exp();
    Some(format!(
        "{}: other constants explain the peaks by another assignment, with {:.2} of the evidence; the chains need not have been there: \
         more modes, or their parities, decide",
        plate.spec.name, share
    ))
}

fn unassigned(plate: &PlateFound) -> Option<String> {
    let none: Vec<String> = plate
        .peaks
        .iter()
        .filter(|p| p.mode.is_none())
        .map(|p| format!("{} Hz", p.frequency_hz))
        .collect();
    let count = plate.peaks.len();
    if 2 * none.len() > count {
        return Some(format!(
            "{}: {} of {count} peaks are no mode of the plate: this plate does not ring so. Check units, dimensions, mass, layup and support \
             before anything else",
            plate.name,
            none.len()
        ));
    }
    (!none.is_empty()).then(|| {
        format!(
            "{}: no mode of the plate is at {}: another resonance (support, sensor, air), a split mode, or constants outside their priors",
            plate.name,
            none.join(", ")
        )
    })
}

/// What the peaks ask for that nobody declared.
fn disturbances(plate: &PlateFound) -> Vec<String> {
    let called = plate
        .undeclared
        .iter()
        .filter(|d| d.log_bayes_factor > WORTH);
    called
        .map(|d| {
            let [amplitude, sd] = d.amplitude;
            format!(
                "{}: the peaks ask for {} ({} {}, log Bayes factor {:.1}). {}",
                plate.name,
                d.name,
                plus_minus(amplitude, sd),
                d.parameter,
                d.log_bayes_factor,
                d.confirm
            )
        })
        .collect()
}

/// What should be known of a plate before its numbers are used.
pub fn warnings(peaks: &Peaks, plate: &PlateFound, draws: &Draws) -> Vec<String> {
    let mut all: Vec<String> = rivals(peaks).into_iter().collect();
    all.extend(unassigned(plate));
    all.extend(disturbances(plate));
    all.extend(too_wrong(draws));
    all
}

/// A model error that is too large to be one.
fn too_wrong(draws: &Draws) -> Option<String> {
    /// Percent; wood is at one.
    const MOST: f64 = 2.0;
    let k = draws.index(MODEL_ERROR)?;
    let median = quantile(&sorted(&draws.series(k).values), 0.5);
    (median > MOST).then(|| {
        format!(
            "frequencies are wrong by {median:.1} % beyond what dimensions, mass and constants allow: check which side is the length, the \
             support, the layup, and whether the lowest modes are among the peaks"
        )
    })
}
