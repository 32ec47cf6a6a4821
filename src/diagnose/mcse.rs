//! Monte Carlo standard errors: Vehtari et al. (2021), section 4.4, as in posterior and ArviZ.

use statrs::function::beta::beta_reg;

use super::ess::{ess_mean, ess_quantile};
use super::transform::{map, mean, sd, sorted};
use super::usable;
use crate::chain::ScalarDraws;
use crate::numeric::bisect;

/// Standard error of the mean: sd / sqrt(ESS of the mean).
pub fn mcse_mean(series: &ScalarDraws) -> f64 {
    sd(&series.values) / ess_mean(series).sqrt()
}

/// Standard error of the standard deviation, by the delta method on the squared deviations.
pub fn mcse_sd(series: &ScalarDraws) -> f64 {
    if !usable(series) {
        return f64::NAN;
    }
    let centre = mean(&series.values);
    let squares = map(series, |v| (v - centre) * (v - centre));
    let second = mean(&squares.values);
    let fourth = squares.values.iter().map(|v| v * v).sum::<f64>() / squares.values.len() as f64;
    let variance = (fourth - second * second) / ess_mean(&squares);
    (variance / second / 4.0).sqrt()
}

/// Standard error of the quantile at `p`: half the distance of the order statistics one sd of the quantile's own
/// Beta distribution to either side.
pub fn mcse_quantile(series: &ScalarDraws, p: f64) -> f64 {
    let effective = ess_quantile(series, p);
    if effective.is_nan() {
        return f64::NAN;
    }
    let sorted = sorted(&series.values);
    let n = sorted.len() as f64;
    let (a, b) = (effective * p + 1.0, effective * (1.0 - p) + 1.0);
    let place = |probability| beta_quantile(probability, a, b) * n - 1.0;
    let low = place(0.1586553).max(0.0).floor() as usize;
    let high = place(0.8413447).min(n - 1.0).max(0.0).ceil() as usize;
    0.5 * (sorted[high] - sorted[low])
}

/// Quantile of Beta(a, b) by bisection; by the normal limit where the Beta is that narrow (at one sd to either side the
/// skewness cancels to first order).
fn beta_quantile(probability: f64, a: f64, b: f64) -> f64 {
    if a.min(b) > 2e4 {
        let centre = a / (a + b);
        let sd = (centre * (1.0 - centre) / (a + b + 1.0)).sqrt();
        return centre + if probability < 0.5 { -sd } else { sd };
    }
    bisect(0.0, 1.0, |x| beta_reg(a, b, x) < probability)
}
