//! How far what a round says of the constants by the field alone disagrees with what other experiments say.

use super::evidence::Evidence;
use super::round::Round;
use crate::infer::{Moments, Tension};
use crate::noise::NormalEquations;

/// Size of the effects that were not found but may act, prior sds.
const UNSEEN: f64 = 0.1;

/// The tension between the field, with the effects that were found and a little of all others, and the experiments beside it.
pub fn tension(round: &Round) -> Option<Tension> {
    let known = round.model.known.as_ref()?;
    let priors = round.model.marginals();
    let field = field_alone(round)?;
    Tension::between(&field, &known.moments()?, &priors)
}

/// Mean and covariance of the constants by the field of a round alone under its likeliest noise, with the effects that were found and a
/// little of all others.
pub fn field_alone(round: &Round) -> Option<Moments> {
    let Evidence {
        sensitivities,
        weighing,
        subsets,
        ..
    } = &round.traced.evidence;
    let gram = weighing.noise.gram(&weighing.pairs[subsets.best_pair]);
    let data = gram.nrows() - 1;
    let base = sensitivities.base.len();
    let acting = subsets.layout.columns(subsets.best());
    let size = |k: usize| match k.checked_sub(base) {
        Some(k) if !acting.contains(&k) => UNSEEN,
        _ => 1.0,
    };
    let scaled: Vec<(usize, f64)> = (0..sensitivities.columns().count())
        .map(|k| (k, size(k)))
        .collect();
    let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &scaled)?;
    let n = sensitivities.constants;
    let columns = &sensitivities.base[..n];
    let (mean, covariance) = (fit.mean(), fit.covariance());
    Some(Moments {
        mean: nalgebra::DVector::from_fn(n, |k, _| columns[k].mean + columns[k].sd * mean[k]),
        covariance: nalgebra::DMatrix::from_fn(n, n, |i, j| {
            columns[i].sd * columns[j].sd * covariance[(i, j)]
        }),
    })
}
