//! What an answer sums over: choices of the noise, of the effects that act, of the size of all others and of the near-edge rival's.

use super::Supposing;
use super::answer::MixtureChoice;
use crate::error::Result;
use crate::numeric::log_sum_exp;
use crate::trace::averaged::{choices, part};
use crate::trace::evidence::Evidence;
use crate::trace::noise_choices::NoisePair;
use crate::trace::suspect::{RIVAL, settings};
use crate::trace::weighing::Weighing;

/// Parts count until they hold this much of the probability, at most so many.
const MOST_OF_IT: f64 = 0.99;
const PARTS: usize = 32;

/// The likeliest subsets with the likeliest noise and sizes of all other effects.
pub(super) fn likeliest(
    evidence: &Evidence,
    weighing: &Weighing,
) -> Result<(Vec<NoisePair>, Vec<MixtureChoice>)> {
    let (sensitivities, subsets) = (&evidence.sensitivities, &evidence.subsets);
    let mut all = Vec::new();
    for chosen in choices(weighing, sensitivities, subsets)? {
        let pair = weighing.pairs[chosen.pair];
        let choice = MixtureChoice {
            noise: 0,
            own: chosen.own,
            size: chosen.size,
            rival: 0.0,
            log_weight: chosen.log_prior + weighing.log_norm(&pair),
        };
        all.push((chosen.part.log_weight, choice, pair));
    }
    Ok(worth(all))
}

/// Those of some weighed choices that hold most of the probability, with their noise.
fn worth(mut all: Vec<(f64, MixtureChoice, NoisePair)>) -> (Vec<NoisePair>, Vec<MixtureChoice>) {
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let total = log_sum_exp(all.iter().map(|a| a.0));
    let mut held = 0.0;
    let (mut pairs, mut choices) = (Vec::new(), Vec::new());
    for (log, choice, pair) in all.into_iter().take(PARTS) {
        if held > MOST_OF_IT {
            break;
        }
        held += (log - total).exp();
        let noise = place(&mut pairs, pair);
        choices.push(MixtureChoice { noise, ..choice });
    }
    (pairs, choices)
}

/// Where something stands in a list, in which it is put if it is not there.
fn place<T: PartialEq>(list: &mut Vec<T>, wanted: T) -> usize {
    list.iter().position(|k| *k == wanted).unwrap_or_else(|| {
        list.push(wanted);
        list.len() - 1
    })
}

/// The likeliest noise with the likeliest size of the rival.
pub(super) fn with_rival(
    evidence: &Evidence,
    wide: &Weighing,
    supposing: Supposing,
) -> Result<(Vec<NoisePair>, Vec<MixtureChoice>)> {
    let sensitivities = &evidence.sensitivities;
    let effects = if supposing == Supposing::All {
        1.0
    } else {
        0.0
    };
    let sizes: &[f64] = if sensitivities.near_edge.is_empty() {
        &[0.0]
    } else {
        &RIVAL
    };
    let mut all = Vec::new();
    for (pair, _) in settings(wide, sensitivities)? {
        for &rival in sizes {
            let log = part(wide, sensitivities, &pair, [effects, rival])?.log_weight;
            let choice = MixtureChoice {
                noise: 0,
                own: Vec::new(),
                size: effects,
                rival,
                log_weight: wide.log_norm(&pair),
            };
            all.push((log, choice, pair));
        }
    }
    Ok(worth(all))
}
