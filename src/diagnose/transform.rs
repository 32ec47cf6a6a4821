//! What R-hat and ESS are computed on: halves of chains, ranks, folds, quantiles.

use crate::chain::ScalarDraws;
use statrs::distribution::{ContinuousCDF, Normal};

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Sample standard deviation of all values (n - 1).
pub fn sd(values: &[f64]) -> f64 {
    variance(values).sqrt()
}

pub(super) fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    sum / (values.len() as f64 - 1.0)
}

/// The values in increasing order.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// First and second half of every chain as chains of their own, the middle draw of an odd number left out. The
/// ensemble of a half is 2 e for the first and 2 e + 1 for the second.
pub(super) fn split(series: &ScalarDraws) -> ScalarDraws {
    let half = series.draws / 2;
    let mut values = Vec::with_capacity(2 * half * series.chains());
    let mut ensemble = Vec::with_capacity(2 * series.chains());
    for (chain, &group) in series.ensemble.iter().enumerate() {
        let all = series.chain(chain);
        values.extend_from_slice(&all[..half]);
        values.extend_from_slice(&all[series.draws - half..]);
        ensemble.extend([2 * group, 2 * group + 1]);
    }
    ScalarDraws {
        values,
        draws: half,
        ensemble,
    }
}

/// Normal scores of the ranks over all chains, ties averaged, with Blom's offset 3/8 (Vehtari et al. 2021, Eq. 14).
pub(super) fn normal_scores(series: &ScalarDraws) -> ScalarDraws {
    let n = series.values.len();
    let mut order: Vec<u32> = (0..n as u32).collect();
    order
        .sort_unstable_by(|&a, &b| series.values[a as usize].total_cmp(&series.values[b as usize]));
    let normal = Normal::standard();
    let mut scores = vec![0.0; n];
    let mut first = 0;
    while first < n {
        let value = series.values[order[first] as usize];
        let ties = order[first..].iter();
        let count = ties
            .take_while(|&&i| series.values[i as usize] == value)
            .count();
        let rank = first as f64 + 0.5 * (count as f64 + 1.0);
        let score = normal.inverse_cdf((rank - 0.375) / (n as f64 + 0.25));
        for &i in &order[first..first + count] {
            scores[i as usize] = score;
        }
        first += count;
    }
    ScalarDraws {
        values: scores,
        draws: series.draws,
        ensemble: series.ensemble.clone(),
    }
}

/// The series with `f` applied to every value.
pub(super) fn map(series: &ScalarDraws, f: impl Fn(f64) -> f64) -> ScalarDraws {
    ScalarDraws {
        values: series.values.iter().map(|&v| f(v)).collect(),
        draws: series.draws,
        ensemble: series.ensemble.clone(),
    }
}
