//! Constants from the frequencies of plates: the joint posterior of all experiments sampled, and what each peak is.

use rayon::prelude::*;

use super::{Options, Reporting};
use crate::chain::Draws;
use crate::diagnose::{Rule, Verdict, diagnose, weigh};
use crate::error::{Error, Result};
use crate::experiment::frequencies::{Mode, Ritz};
use crate::infer::{Disturbed, FrequenciesModel, Joint, MODEL_ERROR, Peaks, joint};
use crate::progress::Progress;
use crate::quantity::plus_minus;
use crate::sample::LogDensity;
use crate::sample::{self, Schedule, Start, Stopped};

/// What the peaks say.
pub struct FrequenciesFound {
    pub draws: Draws,
    pub stopped: Stopped,
    pub verdict: Verdict,
    /// The sampled density against exact frequencies.
    pub exact: Exact,
    /// One an experiment.
    pub plates: Vec<PlateFound>,
    pub warnings: Vec<String>,
}

/// What exact frequencies say of draws that second-order ones made, by importance.
pub struct Exact {
    pub draws: usize,
    /// Effective draws over draws.
    pub effective: f64,
    /// Largest shift of the mean of a parameter, posterior sds.
    pub shift_sd: f64,
}

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
    pub disturbed: Vec<Disturbed>,
}

/// A measured peak.
pub struct PeakFound {
    pub frequency_hz: f64,
    /// Its measured parity, where that is known.
    pub odd: Option<bool>,
    /// Index of the mode that it is most probably, and how probably; none where it is more probably no mode.
    pub mode: Option<usize>,
    pub probability: f64,
}

/// A mode.
pub struct ModeFound {
    /// Numbers of half-waves along length and width.
    pub label: [usize; 2],
    pub odd: Option<bool>,
    /// Over the posterior.
    pub mean_hz: f64,
    pub sd_hz: f64,
    /// Probability that it left no peak.
    pub missing: f64,
    /// Deflection, 1 at most, row by row from low y.
    pub shape: Vec<f64>,
}

/// Draws over which peaks are assigned.
const DRAWS: usize = 200;
/// Deflections along the longer side.
const SHAPE: usize = 61;
/// Spread of the start about the likeliest top.
const SPREAD: f64 = 1.5;
/// Change of tau that ends the run, and steps between draws; see the posterior to quote.
const TAU_CHANGE: f64 = 0.1;
const THIN: usize = 4;
/// Windows of warm-up, and draws, at most: chains that have not settled then are said not to have converged.
const WARMUP: usize = 16;
const MOST_DRAWS: usize = 1 << 18;
/// Evidence over that of the best top, logarithm, from which another assignment is worth a warning.
const RIVAL: f64 = -4.6;

/// The rule by which draws are enough.
pub fn frequencies_rule(given: &Rule) -> Rule {
    Rule {
        tau_change: given.tau_change.max(TAU_CHANGE),
        ..*given
    }
}

/// Identify the constants of a model from its plates' frequencies.
///
/// # Errors
/// The input's fault: priors within which no plate is; those of the samplers.
pub fn identify_frequencies(
    model: &FrequenciesModel,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<FrequenciesFound> {
    progress.begin("likely assignments of the peaks", None);
    let peaks = model.plates()?;
    progress.end();
    let target = joint(model, peaks.clone())?;
    progress.begin(
        &format!(
            "sampling {} parameters with 4 x {}",
            target.dim(),
            options.sampler.name()
        ),
        None,
    );
    let outcome = sampled(&target, options, progress)?;
    progress.end();
    let rule = frequencies_rule(&options.rule);
    let verdict = diagnose(&outcome.draws, &rule);
    progress.begin("assigning peaks over the posterior", None);
    let exact = exact(&peaks, &target, &outcome.draws, &verdict);
    let mean: Vec<f64> = verdict.rows.iter().map(|row| row.mean).collect();
    let plates: Vec<PlateFound> = peaks
        .iter()
        .enumerate()
        .map(|(e, plate)| found(plate, &target, e, (&outcome.draws, &mean)))
        .collect::<Result<_>>()?;
    progress.end();
    let mut warnings: Vec<String> = peaks.iter().filter_map(rivals).collect();
    warnings.extend(plates.iter().flat_map(unassigned));
    warnings.extend(plates.iter().flat_map(disturbances));
    warnings.extend(too_wrong(&verdict));
    warnings.extend(exact.warning());
    Ok(FrequenciesFound {
        draws: outcome.draws,
        stopped: outcome.stopped,
        verdict,
        exact,
        plates,
        warnings,
    })
}

fn sampled(
    target: &Joint,
    options: &Options<'_>,
    progress: &dyn Progress,
) -> Result<sample::Outcome> {
    let (centre, sd) = target.start();
    let dim = target.dim();
    let mut covariance = vec![0.0; dim * dim];
    for (k, sd) in sd.iter().enumerate() {
        covariance[k * (dim + 1)] = sd * sd;
    }
    let start = Start::Ball {
        centre: &centre,
        covariance: &covariance,
        spread: SPREAD,
    };
    let given = &options.schedule;
    let schedule = Schedule {
        warmup_windows: given.warmup_windows.min(WARMUP),
        max_draws: given.max_draws.min(MOST_DRAWS),
        thin: given.thin.or(Some(THIN)),
        ..given.clone()
    };
    let monitor = Reporting {
        progress,
        deadline: options.deadline,
    };
    let rule = frequencies_rule(&options.rule);
    let keeping = options.keeping.as_ref();
    let outcome = sample::run_kept(
        target,
        options.sampler,
        &start,
        &schedule,
        &rule,
        &monitor,
        keeping,
    )?;
    if outcome.draws.is_empty() {
        return Err(Error::limit("--time-limit", "time for draws").found("none"));
    }
    Ok(outcome)
}

/// Some of the draws, evenly spread.
fn some(draws: &Draws, count: usize) -> impl Iterator<Item = &[f64]> {
    let total = draws.chains() * draws.draws();
    let count = count.min(total);
    (0..count).map(move |k| {
        let at = k * total / count;
        draws.point(at / draws.draws(), at % draws.draws())
    })
}

/// Weigh draws by exact frequencies.
fn exact(plates: &[Peaks], target: &Joint, draws: &Draws, verdict: &Verdict) -> Exact {
    /// Draws that are weighed.
    const WEIGHED: usize = 1000;
    let points: Vec<&[f64]> = some(draws, WEIGHED).collect();
    let of = |x: &&[f64]| -> f64 {
        let each = plates.iter().enumerate().map(|(e, plate)| {
            let own = target.own(e, x);
            let seen = plate.seen(&own);
            seen.map_or(f64::NEG_INFINITY, |seen| plate.correction(&own, &seen))
        });
        each.sum()
    };
    let corrections: Vec<f64> = points.par_iter().map(of).collect();
    let weighed = weigh(&points, &corrections);
    let shifts = weighed.shifts.iter().zip(&verdict.rows);
    Exact {
        draws: points.len(),
        effective: weighed.effective,
        shift_sd: shifts
            .map(|([shift, _], row)| shift.abs() / row.sd)
            .fold(0.0, f64::max),
    }
}

impl Exact {
    fn warning(&self) -> Option<String> {
        /// Shift of a mean, posterior sds, and effective share of the draws that are worth a word.
        const MOST: f64 = 0.3;
        const LEAST: f64 = 0.3;
        (self.shift_sd > MOST || self.effective < LEAST).then(|| {
            format!(
                "frequencies to second order about the likeliest plate do not reach over the whole posterior: by exact ones its means move \
                 by up to {:.2} sd ({:.0} % of the draws are effective); more peaks, or tighter priors, make it narrower",
                self.shift_sd,
                100.0 * self.effective
            )
        })
    }
}

/// Peaks and modes of experiment `e` over draws.
fn found(
    plate: &Peaks,
    target: &Joint,
    e: usize,
    (draws, mean): (&Draws, &[f64]),
) -> Result<PlateFound> {
    let points = some(draws, DRAWS).map(|x| target.own(e, x));
    let seen: Vec<_> = points.filter_map(|x| plate.seen(&x)).collect();
    let Some(first) = seen.first() else {
        return Err(Error::program("frequencies", "draws that some plate has"));
    };
    let band = plate.spec.peak_model(0.01).band_hz;
    let mut modes: Vec<(f64, usize, ModeFound, Vec<f64>)> = Vec::new();
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
                odd: mode.odd,
                mean_hz,
                sd_hz: variance.sqrt(),
                missing: own.iter().map(|o| o.1).sum::<f64>() / n,
                shape: shape(plate.ritz(), mode, grid),
            };
            modes.push((mean_hz, modes.len(), found, matched));
        }
    }
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let peaks = plate.spec.peaks().into_iter().enumerate();
    let peaks = peaks
        .map(|(i, peak)| {
            let best = modes
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.3[i].total_cmp(&b.1.3[i]));
            let no_mode = (1.0 - modes.iter().map(|m| m.3[i]).sum::<f64>()).clamp(0.0, 1.0);
            let best = best.filter(|(_, m)| m.3[i] > no_mode);
            PeakFound {
                frequency_hz: peak.frequency_hz,
                odd: peak.odd,
                mode: best.map(|(k, _)| k),
                probability: best.map_or(no_mode, |(_, m)| m.3[i]),
            }
        })
        .collect();
    Ok(PlateFound {
        name: plate.spec.name.clone(),
        peaks,
        modes: modes.into_iter().map(|m| m.2).collect(),
        grid,
        size_mm: side,
        disturbed: plate.disturbed(&target.own(e, mean)),
    })
}

fn grid([length, width]: [f64; 2]) -> [usize; 2] {
    let longest = length.max(width);
    [length, width].map(|side| ((SHAPE as f64 * side / longest).round() as usize).max(8))
}

/// The deflection, 1 at most.
fn shape(ritz: &Ritz, mode: &Mode, [columns, rows]: [usize; 2]) -> Vec<f64> {
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
    /// Log Bayes factor from which it is worth a word.
    const WORTH: f64 = 3.0;
    let called = plate
        .disturbed
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

/// A model error that is too large to be one.
fn too_wrong(verdict: &Verdict) -> Option<String> {
    /// Percent; wood is at one.
    const MOST: f64 = 2.0;
    let row = verdict
        .rows
        .iter()
        .find(|r| r.name.ends_with(MODEL_ERROR))?;
    (row.median > MOST).then(|| {
        format!(
            "frequencies are wrong by {:.1} % beyond what dimensions, mass and constants allow: check which side is the length, the support, the \
             layup, and whether the lowest modes are among the peaks",
            row.median
        )
    })
}
