//! A prior that is wrong and narrow is a suspect like any effect: a rival in which it is widened, weighed against the same data. Where it
//! wins, no effect is named in its place, and the interval to quote holds what the data ask for.

use super::averaged::{Interval, normal};
use super::subsets::SubsetPosterior;
use super::suspect::{ConditionalAnswer, PriorInDoubt};
use crate::files::Keyed;
use crate::linearise::{Column, Sensitivities};
use crate::noise::NormalEquations;
use crate::posterior::Weighing;
use crate::quantity::plus_minus;

/// By how much a prior under suspicion is widened.
const WIDER: f64 = 10.0;

/// Log Bayes factor from which a wider prior is called for: odds of 20.
const CALLED_FOR: f64 = 3.0;

/// Effects are the better account if a wider prior lacks more than this share of their log odds, and more than [`CALLED_FOR`].
const LACKS: f64 = 0.2;

/// A constant leans on its prior where the data alone know it to more than this share of the prior's variance, and is spoken of where both
/// differ by this many sds of both together.
const LEANS: f64 = 0.5;
const DIFFER: f64 = 1.5;

/// What the data alone say of constants that lean on their priors and are pulled by them, in sentences. Those whose prior is in doubt are told of
/// already.
pub(super) fn leaning(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
    doubted: &[PriorInDoubt],
) -> Vec<String> {
    let gram = weighing.gram(&weighing.pairs[subsets.best_pair]);
    let base = &sensitivities.base;
    let data = gram.nrows() - 1;
    let acting = subsets.layout.columns(subsets.best());
    let words = |k: usize| {
        let own = (0..base.len()).map(|j| (j, if j == k { WIDER } else { 1.0 }));
        let acting = acting.iter().map(|j| (base.len() + j, 1.0));
        let columns: Vec<(usize, f64)> = own.chain(acting).collect();
        let fit = NormalEquations::of_columns(&gram, |j| gram[(j, data)], &columns)?;
        let (column, at, variance) = (&base[k], fit.mean()[k], fit.covariance()[(k, k)]);
        // the wide prior divided out, in sds of the declared one
        let share = 1.0 - variance;
        let (off, own) = (WIDER * at / share, WIDER * WIDER * variance / share);
        let differ = off.abs() / (1.0 + own).sqrt();
        (own > LEANS && share > LEANS && differ > DIFFER).then(|| {
            format!(
                "{} leans on its prior, which says {}: the data alone say {}.",
                column.name,
                plus_minus(column.mean, column.sd),
                plus_minus(column.mean + column.sd * off, column.sd * own.sqrt())
            )
        })
    };
    let is_doubted = |k: &usize| doubted.iter().any(|d| d.constant == base[*k].name);
    let constants = (0..sensitivities.constants).filter(|k| !is_doubted(k));
    constants.filter_map(words).collect()
}

/// Constants whose prior the data contradict, unless effects account for the residual much better than a wider prior.
pub(super) fn priors_in_doubt(
    weighing: &Weighing,
    sensitivities: &Sensitivities,
    subsets: &SubsetPosterior,
) -> Vec<PriorInDoubt> {
    let gram = weighing.noise.gram(&weighing.pairs[subsets.best_pair]);
    let data = gram.nrows() - 1;
    let base = sensitivities.base.len();
    let fit = |wide: Option<usize>, effects: &[usize]| {
        let own = (0..base).map(|k| (k, if wide == Some(k) { WIDER } else { 1.0 }));
        let acting = effects.iter().map(|k| (base + k, 1.0));
        let columns: Vec<(usize, f64)> = own.chain(acting).collect();
        NormalEquations::of_columns(&gram, |k| gram[(k, data)], &columns)
    };
    let acting = subsets.layout.columns(subsets.best());
    let (Some(bare), Some(explained)) = (fit(None, &[]), fit(None, &acting)) else {
        return Vec::new();
    };
    let bare = bare.log_evidence();
    let rarer = subsets.log_prior(subsets.best().len()) - subsets.log_prior(0);
    let by_effects = explained.log_evidence() - bare + rarer;
    let doubt = |k: usize| {
        let wide = fit(Some(k), &[])?;
        let gain = wide.log_evidence() - bare;
        let wins = gain > CALLED_FOR && gain > by_effects - CALLED_FOR.max(LACKS * by_effects);
        wins.then(|| doubt_in(&sensitivities.base[..sensitivities.constants], k, &wide))
    };
    (0..sensitivities.constants).filter_map(doubt).collect()
}

/// The doubt in the prior of constant `k`, of which these are the columns, from the fit with a wider one.
fn doubt_in(columns: &[Column], k: usize, wide: &NormalEquations) -> PriorInDoubt {
    let (mean, covariance) = (wide.mean(), wide.covariance());
    let of = |i: usize| {
        let by = columns[i].sd * if i == k { WIDER } else { 1.0 };
        (
            columns[i].mean + by * mean[i],
            by * covariance[(i, i)].sqrt(),
        )
    };
    let names = columns.iter().enumerate();
    let constants: Keyed<Interval> = names
        .map(|(i, c)| (c.name.clone(), normal(of(i))))
        .collect();
    let column = &columns[k];
    let (asked, sd) = of(k);
    PriorInDoubt {
        constant: column.name.clone(),
        words: format!(
            "the data ask for {} = {}, and its prior says {}: check the prior, the force and the thickness",
            column.name,
            plus_minus(asked, sd),
            plus_minus(column.mean, column.sd)
        ),
        answer: ConditionalAnswer {
            supposing: format!(
                "no effect, and a prior of {} that is {WIDER:.0} times as wide",
                column.name
            ),
            constants,
        },
    }
}
