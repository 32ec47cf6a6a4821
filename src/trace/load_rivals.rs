//! Where an error of the load and something else explain a residual equally well, and the constants depend on which it is: neither is named
//! alone, and the interval to quote spans the answers of all. Of two steps whose forces contradict each other either may be wrong.

use super::alias::{AliasGroup, SWAP};
use super::averaged::supposing;
use super::subsets::{Subset, SubsetPosterior, WeighedSubset};
use super::suspect::ConditionalAnswer;
use crate::effect::Scope;
use crate::error::Result;
use crate::linearise::Sensitivities;
use crate::posterior::Weighing;

/// Answers of constants that differ by more of their sds are different.
const APART: f64 = 1.0;

/// Answers beside that of the best subset, at most.
const MOST: usize = 8;

/// The constants by the best subset and by those that do without a group's leader and cannot be excluded, where an error of the load is
/// among what they differ by and the constants differ; none where it does not matter which of them acts.
///
/// # Errors
/// Of the program, for columns that are not finite.
pub(super) fn load_rivals(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
    group: &AliasGroup,
) -> Result<Vec<ConditionalAnswer>> {
    let ranked = &subsets.ranked;
    let is_load = |k: &usize| {
        let effect = sensitivities.candidates[*k].effect;
        effect.scope() == Scope::Force
    };
    let best = &ranked[0];
    let is_rival = |w: &&WeighedSubset| {
        let own = w.subset.iter().filter(|k| !best.subset.contains(k));
        let mut differing = own.chain([&group.leader]);
        let probable = best.log_weight - w.log_weight < SWAP;
        // by another law it is the same effect
        let has_leader = |k: &usize| subsets.layout.same(*k, group.leader);
        probable && !w.subset.iter().any(has_leader) && differing.any(is_load)
    };
    let rivals: Vec<&WeighedSubset> = ranked.iter().filter(is_rival).take(MOST).collect();
    if rivals.is_empty() {
        return Ok(Vec::new());
    }
    let all = [best].into_iter().chain(rivals);
    let answers: Vec<ConditionalAnswer> = all
        .map(|w| with_subset(weighing, sensitivities, subsets, &w.subset))
        .collect::<Result<_>>()?;
    let differs = |name: &String| {
        let of = answers.iter().filter_map(|a| a.constants.get(name));
        let (mut low, mut high, mut sd) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
        for i in of {
            (low, high, sd) = (low.min(i.mean), high.max(i.mean), sd.min(i.sd));
        }
        high - low > APART * sd
    };
    let apart = answers[0].constants.keys().any(differs);
    Ok(if apart { answers } else { Vec::new() })
}

/// The constants where the effects of a subset act.
fn with_subset(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
    subset: &Subset,
) -> Result<ConditionalAnswer> {
    let own = subsets.layout.columns(subset);
    let pair = &weighing.pairs[subsets.best_pair];
    let name = |k: &usize| {
        let candidate = &sensitivities.candidates[*k];
        let law = candidate.law.map(|law| format!(" ({})", law.words()));
        format!("{}{}", candidate.effect.name(), law.unwrap_or_default())
    };
    let acting: Vec<String> = subset.iter().map(name).collect();
    let acting = match acting.is_empty() {
        true => "no effect".into(),
        false => acting.join(" and "),
    };
    Ok(ConditionalAnswer {
        supposing: format!("{acting}, and others as small as the data say"),
        constants: supposing(weighing, sensitivities, pair, &own)?,
    })
}
