//! Effective sample sizes: Vehtari et al. (2021), section 3.2, with Geyer's (1992) initial monotone sequence, as in
//! posterior and ArviZ. The autocorrelation is each walker's own; walkers enter as chains. Walkers of an ensemble can
//! also wander together (an ensemble that misses a tail proposes none of it), which no walker's own autocorrelation
//! shows: so the ESS is never above that of the ensembles' mean values over time. For single chains the two are one.

use super::autocov::mean_autocovariance;
use super::transform::{map, mean, normal_scores, sorted, split, variance};
use super::usable;
use crate::chain::ScalarDraws;
use crate::numeric::quantile;

/// Effective number of draws for the bulk: of the rank-normalised split chains.
pub fn ess_bulk(series: &ScalarDraws) -> f64 {
    guarded(series, || ess(&normal_scores(&split(series))))
}

/// The smaller of the effective numbers of draws for the 5 % and the 95 % quantile.
pub fn ess_tail(series: &ScalarDraws) -> f64 {
    guarded(series, || {
        let sorted = sorted(&series.values);
        let at = |p| indicator_ess(series, quantile(&sorted, p));
        let (low, high) = (at(0.05), at(0.95));
        if low.is_nan() || high.is_nan() {
            return f64::NAN;
        }
        low.min(high)
    })
}

/// Effective number of draws for the mean.
pub fn ess_mean(series: &ScalarDraws) -> f64 {
    guarded(series, || ess(&split(series)))
}

/// Effective number of draws for the quantile at `p`.
pub fn ess_quantile(series: &ScalarDraws, p: f64) -> f64 {
    guarded(series, || {
        indicator_ess(series, quantile(&sorted(&series.values), p))
    })
}

fn guarded(series: &ScalarDraws, estimate: impl Fn() -> f64) -> f64 {
    if usable(series) { estimate() } else { f64::NAN }
}

/// The same with the quantile already known.
pub(super) fn indicator_ess(series: &ScalarDraws, level: f64) -> f64 {
    ess(&split(&map(series, |v| f64::from(v <= level))))
}

/// Effective number of draws: of the walkers, or of the ensembles' means if that is less. NaN if constant.
fn ess(series: &ScalarDraws) -> f64 {
    let groups = series.groups();
    let single = ess_of_chains(series);
    if groups.len() == series.chains() {
        return single;
    }
    let means: Vec<f64> = groups
        .iter()
        .flat_map(|chains| {
            let at = |t| {
                chains
                    .iter()
                    .map(|&c| series.values[c * series.draws + t])
                    .sum::<f64>()
            };
            (0..series.draws).map(move |t| at(t) / chains.len() as f64)
        })
        .collect();
    let means = ScalarDraws::of_chains(means, series.draws);
    // Independent walkers would give the means a variance smaller by their number; what counts is the variance that
    // the grand mean has.
    let collective = ess_of_chains(&means) * variance(&series.values) / variance(&means.values);
    if collective.is_nan() {
        single
    } else {
        single.min(collective)
    }
}

/// Effective number of draws of chains as they are; NaN if they are constant.
fn ess_of_chains(series: &ScalarDraws) -> f64 {
    let (n, chains) = (series.draws, series.chains());
    let mut centred = series.values.clone();
    let mut means = Vec::with_capacity(chains);
    for chain in centred.chunks_exact_mut(n) {
        let centre = mean(chain);
        chain.iter_mut().for_each(|v| *v -= centre);
        means.push(centre);
    }
    let autocovariance = mean_autocovariance(&centred, n);
    let within = autocovariance[0] * n as f64 / (n as f64 - 1.0);
    let mut total = autocovariance[0];
    if chains > 1 {
        total += variance(&means);
    }
    if total.is_nan() || total <= 0.0 {
        return f64::NAN;
    }
    let rho = |lag: usize| {
        if lag == 0 {
            1.0
        } else {
            1.0 - (within - autocovariance[lag]) / total
        }
    };
    let count = (n * chains) as f64;
    // Antithetic draws are worth more than independent ones, but not without limit.
    count / geyer(rho, n).max(1.0 / count.log10())
}

/// -1 + 2 sum of the autocorrelations over Geyer's initial monotone sequence.
fn geyer(rho: impl Fn(usize) -> f64, n: usize) -> f64 {
    let mut kept = vec![0.0; n];
    let (mut even, mut odd) = (1.0, rho(1));
    (kept[0], kept[1]) = (even, odd);
    let mut t = 1;
    while t + 3 < n && even + odd > 0.0 {
        (even, odd) = (rho(t + 1), rho(t + 2));
        if even + odd >= 0.0 {
            (kept[t + 1], kept[t + 2]) = (even, odd);
        }
        t += 2;
    }
    // With three or fewer draws a half the sequence is its first pair.
    let last = t as isize - 2;
    let next = (last + 1) as usize;
    if even > 0.0 {
        kept[next] = even;
    }
    let mut t = 1;
    while (t as isize) <= last - 2 {
        let before = kept[t - 1] + kept[t];
        if kept[t + 1] + kept[t + 2] > before {
            kept[t + 1] = 0.5 * before;
            kept[t + 2] = 0.5 * before;
        }
        t += 2;
    }
    -1.0 + 2.0 * kept[..next].iter().sum::<f64>() + kept[next]
}
