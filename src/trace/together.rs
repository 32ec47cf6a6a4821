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
    Tension::between(&field_alone(round)?, &known.moments()?, &priors)
}

/// Mean and covariance of the constants by the field of a round alone, with the effects that were found and a little of all others.
pub fn field_alone(round: &Round) -> Option<Moments> {
    round.account.evidence.field_alone()
}

impl Evidence {
    /// Constants by the field alone, under its likeliest noise.
    fn field_alone(&self) -> Option<Moments> {
        let pair = &self.weighing.pairs[self.subsets.best_pair];
        let gram = self.weighing.gram_of_field(pair);
        let data = gram.nrows() - 1;
        let base = self.sensitivities.base.len();
        let acting = self.subsets.layout.columns(self.subsets.best());
        let sought = self
            .sensitivities
            .candidates
            .iter()
            .map(|c| c.columns.len());
        let candidates = (0..sought.sum()).map(|k| {
            let size = if acting.contains(&k) { 1.0 } else { UNSEEN };
            (base + k, size)
        });
        let scaled: Vec<(usize, f64)> = (0..base).map(|k| (k, 1.0)).chain(candidates).collect();
        let fit = NormalEquations::of_columns(&gram, |k| gram[(k, data)], &scaled)?;
        let n = self.sensitivities.constants;
        let columns = &self.sensitivities.base[..n];
        let (mean, covariance) = (fit.mean(), fit.covariance());
        Some(Moments {
            mean: nalgebra::DVector::from_fn(n, |k, _| columns[k].mean + columns[k].sd * mean[k]),
            covariance: nalgebra::DMatrix::from_fn(n, n, |i, j| {
                columns[i].sd * columns[j].sd * covariance[(i, j)]
            }),
        })
    }
}
