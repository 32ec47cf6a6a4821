//! What an answer sums over: choices of the noise, of the effects that act, of the size of all others and of the near-edge rival's.

use super::Scenario;
use crate::error::Result;
use crate::numeric::log_sum_exp;
use crate::posterior::MixtureChoice;
use crate::posterior::NoisePair;
use crate::posterior::Weighing;
use crate::sample::NormalPart;
use crate::trace::averaged::{PAIRS, choices, part};
use crate::trace::evidence::Evidence;
use crate::trace::suspect::{RIVAL, settings};

/// Parts count until they hold this much of the probability, at most so many.
const MOST_OF_IT: f64 = 0.99;
const PARTS: usize = 32;

/// What an answer sums over.
#[derive(Default)]
pub(super) struct AnswerChoices {
    /// Choices of the noise.
    pub pairs: Vec<NoisePair>,
    pub parts: Vec<MixtureChoice>,
    /// The constants by each part in closed form, with what the data make of it.
    pub closed: Vec<NormalPart>,
}

/// A part with its noise, before it is known whether it counts.
type Weighable = (MixtureChoice, NoisePair, NormalPart);

/// The likeliest subsets with the likeliest noise and sizes of all other effects.
pub(super) fn likeliest(evidence: &Evidence, weighing: &Weighing) -> Result<AnswerChoices> {
    let (sensitivities, subsets) = (&evidence.sensitivities, &evidence.subsets);
    let mut all = Vec::new();
    for chosen in choices(weighing, sensitivities, subsets, PAIRS)? {
        let pair = weighing.pairs[chosen.pair];
        let choice = MixtureChoice {
            noise: 0,
            own: chosen.own,
            size: chosen.size,
            rival: 0.0,
            log_weight: chosen.log_prior + weighing.log_norm(&pair),
        };
        all.push((choice, pair, chosen.part.normal()));
    }
    Ok(worth(all))
}

/// Those of some weighed choices that hold most of the probability, with their noise.
fn worth(mut all: Vec<Weighable>) -> AnswerChoices {
    all.sort_by(|a, b| b.2.log_weight.total_cmp(&a.2.log_weight));
    let total = log_sum_exp(all.iter().map(|a| a.2.log_weight));
    let mut held = 0.0;
    let mut found = AnswerChoices::default();
    for (choice, pair, closed) in all.into_iter().take(PARTS) {
        if held > MOST_OF_IT {
            break;
        }
        held += (closed.log_weight - total).exp();
        let noise = place(&mut found.pairs, pair);
        found.parts.push(MixtureChoice { noise, ..choice });
        found.closed.push(closed);
    }
    found
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
    supposing: Scenario,
) -> Result<AnswerChoices> {
    let sensitivities = &evidence.sensitivities;
    let effects = if supposing == Scenario::All { 1.0 } else { 0.0 };
    let sizes: &[f64] = if sensitivities.near_edge.is_empty() {
        &[0.0]
    } else {
        &RIVAL
    };
    let mut all = Vec::new();
    for (pair, _) in settings(wide, sensitivities)? {
        for &rival in sizes {
            let closed = part(wide, sensitivities, &pair, [effects, rival])?;
            let choice = MixtureChoice {
                noise: 0,
                own: Vec::new(),
                size: effects,
                rival,
                log_weight: wide.log_norm(&pair),
            };
            all.push((choice, pair, closed.normal()));
        }
    }
    Ok(worth(all))
}
