//! R-hat, rank-normalised, split and folded: Vehtari, Gelman, Simpson, Carpenter & Buerkner (2021), Bayesian Analysis
//! 16, 667, section 3.1 and 3.2.

use super::transform::{map, mean, normal_scores, sorted, split, variance};
use super::usable;
use crate::chain::ScalarDraws;
use crate::numeric::quantile;

/// The larger of the rank-normalised split R-hat and that of the folded draws, across *independent ensembles*: the
/// walkers of an ensemble depend on each other, so each ensemble's walkers are pooled into one group for each half in
/// time. For single chains this is the definition of posterior and ArviZ. Of a single ensemble only its halves in time
/// are compared. NaN as the conventions of [`crate::diagnose`] say.
pub fn rhat(series: &ScalarDraws) -> f64 {
    if !usable(series) {
        return f64::NAN;
    }
    let halves = split(series);
    let median = quantile(&sorted(&halves.values), 0.5);
    let folded = map(&halves, |v| (v - median).abs());
    let bulk = between_groups(&normal_scores(&halves));
    let tail = between_groups(&normal_scores(&folded));
    if bulk.is_nan() || tail.is_nan() {
        return f64::NAN;
    }
    bulk.max(tail)
}

/// sqrt(((n - 1)/n W + B/n) / W) over the groups of a series (Eqs. 1 to 4).
fn between_groups(series: &ScalarDraws) -> f64 {
    let groups = series.groups();
    let pooled: Vec<Vec<f64>> = groups
        .iter()
        .map(|chains| {
            chains
                .iter()
                .flat_map(|&c| series.chain(c))
                .copied()
                .collect()
        })
        .collect();
    // Groups of ensembles of the same size; otherwise their mean size stands in.
    let n = series.values.len() as f64 / groups.len() as f64;
    let means: Vec<f64> = pooled.iter().map(|group| mean(group)).collect();
    let within = mean(
        &pooled
            .iter()
            .map(|group| variance(group))
            .collect::<Vec<f64>>(),
    );
    (variance(&means) / within + (n - 1.0) / n).sqrt()
}
