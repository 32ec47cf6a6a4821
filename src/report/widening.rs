//! Why the averaged posterior is wider than that of the model alone: what may act without being seen.

use super::traced::PROBABLE;
use crate::trace::{BlindSpot, Tracing};

/// Mean and sd of each constant by the model alone.
pub type Alone = Vec<(String, (f64, f64))>;

/// Ratios of the averaged to the bare sd of which nothing is said.
const ALIKE: std::ops::Range<f64> = 0.8..1.1;

/// Blind spots named, at most.
const NAMED: usize = 3;

/// Those that do less than this share of what the first does are not named.
const SHARE: f64 = 0.2;

/// Why the averaged sd of a constant is larger, or smaller, than the model alone gives; nothing where all are alike. Of the most
/// widened constant it is said which unseen effects move it most.
pub fn note(alone: &Alone, tracing: &Tracing) -> Option<String> {
    let mut ratios: Vec<(f64, &str)> = alone
        .iter()
        .filter_map(|(name, (_, sd))| {
            let averaged = tracing.averaged.iter().find(|a| a.name == *name)?;
            Some((averaged.sd / sd, name.as_str()))
        })
        .collect();
    ratios.sort_by(|a, b| b.0.total_cmp(&a.0));
    let list = |chosen: &dyn Fn(f64) -> bool| {
        let chosen = ratios.iter().filter(|(ratio, _)| chosen(*ratio));
        let said: Vec<String> = chosen
            .map(|(ratio, name)| format!("{name} {ratio:.1} times"))
            .collect();
        said.join(", ")
    };
    let (most, most_of) = ratios.first()?;
    if *most >= ALIKE.end {
        let cause = if tracing.leaves_structure() {
            "because the structure that is left is weighed as a smooth error of the model, and effects too small to be seen may act"
        } else {
            "because effects too small to be seen may act"
        };
        return Some(format!(
            "The averaged sd is larger than that of the model alone ({}), {cause}.{} What could move {most_of} most without being seen, with the shift by the largest plausible amplitude below detection: {}.",
            list(&|ratio| ratio >= ALIKE.end),
            moved(alone, tracing),
            movers(tracing, most_of)
        ));
    }
    let narrower = list(&|ratio| ratio < ALIKE.start);
    let explained = tracing
        .candidates
        .iter()
        .any(|c| c.inclusion_probability >= PROBABLE);
    (!narrower.is_empty()).then(|| {
        let cause = if explained {
            "the model alone takes for noise, or for unnamed errors of the model, what the effects weighed here explain"
        } else {
            "the two weigh the noise in different ways, and where no effect was added the wider is the safer to quote"
        };
        format!("The averaged sd is smaller than that of the model alone ({narrower}): {cause}.")
    })
}

/// A constant that moves by more of the model's own sds is said to.
const MOVED_SDS: f64 = 2.0;

/// A sentence about the constants whose averaged mean lies far from the model's own.
fn moved(alone: &Alone, tracing: &Tracing) -> String {
    let shifts = alone.iter().filter_map(|(name, (mean, sd))| {
        let averaged = tracing.averaged.iter().find(|a| a.name == *name)?;
        let shift = averaged.mean - mean;
        let far = shift.abs() > MOVED_SDS * sd;
        far.then(|| format!("{name} by {:+.1} %", 100.0 * shift / mean.abs()))
    });
    let shifts: Vec<String> = shifts.collect();
    if shifts.is_empty() {
        return String::new();
    }
    format!(" The means move with it ({}).", shifts.join(", "))
}

/// The blind spots that move a constant most while these data do not show them.
fn movers(tracing: &Tracing, constant: &str) -> String {
    let mut spots: Vec<(f64, &BlindSpot)> = tracing
        .blind_spots
        .iter()
        .map(|(_, spot)| (unseen(spot, constant), spot))
        .filter(|(shift, _)| shift.is_finite())
        .collect();
    spots.sort_by(|a, b| b.0.total_cmp(&a.0));
    let first = spots.first().map_or(0.0, |(shift, _)| *shift);
    let named: Vec<String> = spots
        .iter()
        .take(NAMED)
        .filter(|(shift, _)| *shift > SHARE * first)
        .map(|(shift, spot)| format!("{} ({shift:.1} %)", spot.parameter))
        .collect();
    named.join(", ")
}

/// Largest shift of a constant, %, by a plausible amplitude that these data would not show.
fn unseen(spot: &BlindSpot, constant: &str) -> f64 {
    let share = (spot.detectable / spot.plausible).min(1.0);
    let shift = spot.shift_percent.iter().find(|(name, _)| name == constant);
    share * shift.map_or(0.0, |(_, s)| s.abs())
}
