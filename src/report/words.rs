//! What the terminal and the page say in the same words.

use super::json::Keyed;
use super::round::MeanAndSd;
use super::tracing::TracingReport;
use crate::identify::PRIOR_SDS;
use crate::trace::{BlindSpot, Interval, UNEXPLAINED};

/// What those shifts mean, in a sentence.
pub const LINEAR: &str =
    "Shifts are linear estimates. Beyond 20 % only their sign is known, and that they are large.";

/// Cosine from which an effect is shown as one that resembles another.
pub const ALIKE: f64 = 0.5;

/// From this probability on it is said what an effect explains: an improbable one, alone, takes what a probable one explains.
pub const PROBABLE: f64 = 0.5;

/// Share of the constants that the quoted intervals hold where a culprit acts that the dictionary lacks and whose field is nearly a change
/// of the constants (50 of 56 in whole loops over seven such effects at one and two prior sds, `tests/physics/loops.rs`).
pub const SILENT_HELD_PERCENT: u32 = 89;

/// What no row can say.
pub fn beyond_the_dictionary() -> String {
    format!(
        "What is in no dictionary has no row. If eight ninths of its field are a change of the constants, one field does not show it. In a test, seven such effects were withheld from the dictionary. The 95 % intervals contained {SILENT_HELD_PERCENT} % of the constants. Another load, another direction or an independent test of one constant would show such an effect."
    )
}

/// What is said of a constant that lies `sds` prior sds from its prior's mean, if it is too far.
pub fn contradiction(sds: f64) -> Option<String> {
    (sds.abs() > PRIOR_SDS).then(|| format!("contradicts the prior by {sds:+.1} sd"))
}

/// Ratio of the averaged sd to that of the model alone from which on something is said.
const WIDER: f64 = 1.1;

/// Why the averaged sd of a constant is larger than that of the model `alone`; nothing where none is. Of
/// the most widened constant it is said which unseen effects move it most.
pub fn widening(
    (alone, averaged): (&Keyed<MeanAndSd>, &Keyed<Interval>),
    tracing: &TracingReport,
    spots: &[BlindSpot],
) -> Option<String> {
    let mut ratios: Vec<(f64, &str)> = alone
        .iter()
        .filter_map(|(name, bare)| Some((averaged.get(name)?.sd / bare.sd, name.as_str())))
        .collect();
    ratios.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (most, most_of) = ratios.first()?;
    if *most < WIDER {
        return None;
    }
    let wider = ratios.iter().filter(|(ratio, _)| *ratio >= WIDER);
    let wider: Vec<String> = wider
        .map(|(r, name)| format!("{name} {r:.1} times"))
        .collect();
    let cause = if tracing.discrepancy_probability > UNEXPLAINED {
        "because the structure that is left is weighed as a smooth error of the model, and effects too small to be seen may act"
    } else {
        "because effects too small to be seen may act"
    };
    Some(format!(
        "The sd to quote is larger than that of the model alone ({}), {cause}.{} These effects could move {most_of} most without being seen: {}. In brackets: the shift by the largest plausible amplitude that would not show.",
        wider.join(", "),
        moved(alone, averaged),
        movers(spots, most_of)
    ))
}

/// A constant that moves by more of the model's own sds is said to.
const MOVED_SDS: f64 = 2.0;

/// A sentence about the constants whose averaged mean lies far from the model's own.
fn moved(alone: &Keyed<MeanAndSd>, averaged: &Keyed<Interval>) -> String {
    let shifts = alone.iter().filter_map(|(name, bare)| {
        let shift = averaged.get(name)?.mean - bare.mean;
        let far = shift.abs() > MOVED_SDS * bare.sd;
        far.then(|| format!("{name} by {:+.1} %", 100.0 * shift / bare.mean.abs()))
    });
    let shifts: Vec<String> = shifts.collect();
    if shifts.is_empty() {
        return String::new();
    }
    format!(" The means move with it ({}).", shifts.join(", "))
}

/// Blind spots named, at most.
const NAMED: usize = 3;

/// Those that do less than this share of what the first does are not named.
const SHARE: f64 = 0.2;

/// The blind spots that move a constant most while these data do not show them.
fn movers(spots: &[BlindSpot], constant: &str) -> String {
    let unseen = |spot: &BlindSpot| {
        let share = (spot.detectable / spot.plausible).min(1.0);
        let shift = spot.shift_in_percent.get(constant).copied();
        share * shift.map_or(0.0, |s| s.map_or(f64::NAN, f64::abs))
    };
    let mut spots: Vec<(f64, String)> = spots.iter().map(|s| (unseen(s), s.name())).collect();
    spots.retain(|(shift, _)| shift.is_finite());
    spots.sort_by(|a, b| b.0.total_cmp(&a.0));
    let first = spots.first().map_or(0.0, |(shift, _)| *shift);
    let named = spots
        .iter()
        .take(NAMED)
        .filter(|(shift, _)| *shift > SHARE * first);
    let named: Vec<String> = named
        .map(|(shift, name)| format!("{name} ({shift:.1} %)"))
        .collect();
    named.join(", ")
}
