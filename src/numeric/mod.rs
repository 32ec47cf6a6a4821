//! Quadrature rules, quantiles and roots, each once for the whole program.

#[cfg(feature = "identify")]
mod forest;
#[cfg(feature = "identify")]
mod quadrature;

#[cfg(feature = "identify")]
pub(crate) use forest::Forest;
#[cfg(feature = "identify")]
pub use quadrature::{hermite, legendre};

/// Quantile at `p` in [0, 1] of values sorted in increasing order, by linear interpolation (R's type 7). NaN if empty.
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let place = p.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// The middle value, of an even number the larger of both; reorders `values`. Zero if there are none.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    *median
}

/// The smallest and the largest value; of none infinities the wrong way round.
pub fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(v), high.max(v)]
    })
}

/// A diagonal matrix, row by row.
pub fn diagonal(values: impl ExactSizeIterator<Item = f64>) -> Vec<f64> {
    let n = values.len();
    let mut matrix = vec![0.0; n * n];
    for (k, value) in values.enumerate() {
        matrix[k * (n + 1)] = value;
    }
    matrix
}

/// log sum exp; -inf of nothing.
pub fn log_sum_exp(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + logs.map(|log| (log - largest).exp()).sum::<f64>().ln()
}

/// Weights over the largest, of their logarithms; zeros where all are -inf.
pub fn relative_weights(logs: &[f64]) -> Vec<f64> {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weight = |log: &f64| match *log == f64::NEG_INFINITY {
        true => 0.0,
        false => (log - largest).exp(),
    };
    logs.iter().map(weight).collect()
}

/// Weights that sum to 1, of their logarithms.
pub fn shares(logs: &[f64]) -> Vec<f64> {
    let weights = relative_weights(logs);
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}

/// Add `amplitude` times a column to a field, of (u1, u2) each.
pub fn add_scaled(field: &mut [[f64; 2]], column: &[[f64; 2]], amplitude: f64) {
    for (u, c) in field.iter_mut().zip(column) {
        u[0] += amplitude * c[0];
        u[1] += amplitude * c[1];
    }
}

/// Where `is_below` turns from true to false between `low` and `high`, to rounding.
pub fn bisect(mut low: f64, mut high: f64, is_below: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        // and where a limit is not a number, at once
        if !(low < middle && middle < high) {
            return middle;
        }
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
}
