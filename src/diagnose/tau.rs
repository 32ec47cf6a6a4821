//! Integrated autocorrelation time: Sokal's automatic window (1989), per walker, averaged as emcee does.

use super::autocov::mean_autocovariance;
use super::usable;
use crate::chain::ScalarDraws;

/// Sokal's constant: the window is the first lag M with M >= 5 tau(M).
const WINDOW: f64 = 5.0;

/// Shortest window, so that antithetic draws (tau < 1) are not cut off after one lag.
const SHORTEST: f64 = 10.0;

/// tau = 1 + 2 sum of the autocorrelation to the window, in stored draws. Autocovariances are taken along each walker
/// about its ensemble's mean and averaged over walkers before they are normalised (emcee normalises first, about each
/// walker's own mean, which is biased low while chains are short). NaN as the conventions of [`crate::diagnose`] say.
pub fn tau(series: &ScalarDraws) -> f64 {
    let Some(autocovariance) = pooled(series) else {
        return f64::NAN;
    };
    let mut tau = 1.0;
    for (lag, value) in autocovariance.iter().enumerate().skip(1) {
        if lag as f64 > (WINDOW * tau).max(SHORTEST) {
            break;
        }
        tau += 2.0 * value / autocovariance[0];
    }
    // Noise must not make a time of it that is not positive.
    tau.max(0.05)
}

/// Relative standard error of [`tau`] (Sokal 1989): the square root of 2 (2 M + 1) / n with the window M and n draws of all chains.
pub fn tau_error(series: &ScalarDraws, tau: f64) -> f64 {
    let window = (WINDOW * tau).max(SHORTEST);
    (2.0 * (2.0 * window + 1.0) / series.values.len() as f64).sqrt()
}

/// Mean autocovariance of the walkers about their ensemble's mean; `None` for series of no use or no variance.
fn pooled(series: &ScalarDraws) -> Option<Vec<f64>> {
    if !usable(series) {
        return None;
    }
    let mut centred = series.values.clone();
    for chains in series.groups() {
        let values = chains.iter().flat_map(|&c| series.chain(c));
        let centre = values.sum::<f64>() / (chains.len() * series.draws) as f64;
        for c in chains {
            let rows = c * series.draws..(c + 1) * series.draws;
            centred[rows].iter_mut().for_each(|v| *v -= centre);
        }
    }
    let autocovariance = mean_autocovariance(&centred, series.draws);
    (autocovariance[0] > 0.0).then_some(autocovariance)
}
