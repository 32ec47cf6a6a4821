//! How far the posterior depends on the prior's cuts and means.

use super::grid::{PosteriorGrid, automatic};
use super::quadrature::GridMoments;
use crate::error::Result;
use crate::infer::Marginal;
use crate::posterior::PosteriorDensity;
use crate::sample::{LogDensity, laplace};

/// One choice of prior.
pub struct PriorRow {
    pub prior: String,
    pub moments: GridMoments,
}

/// Posteriors under the declared prior and without its cuts.
///
/// # Errors
/// Those of a mode without maximum and of the grid.
pub fn compare(posterior: &PosteriorDensity, side: usize) -> Result<Vec<PriorRow>> {
    let declared = posterior.marginals().to_vec();
    let with = |change: &dyn Fn(usize, &mut Marginal)| -> Vec<Marginal> {
        let mut marginals = declared.clone();
        for (k, m) in marginals.iter_mut().enumerate() {
            change(k, m);
        }
        marginals
    };
    let mut choices = vec![("declared".to_string(), declared.clone())];
    let cut = declared.iter().any(|m| m.truncate.is_some());
    let whole = with(&|_, m| m.truncate = None);
    if cut {
        choices.push(("without truncation".into(), whole.clone()));
    }
    let rows = choices.into_iter();
    rows.filter_map(|(prior, marginals)| row(posterior, prior, marginals, side).transpose())
        .collect()
}

/// None where a cut leaves nothing of the posterior: `outside` says so.
fn row(
    posterior: &PosteriorDensity,
    prior: String,
    marginals: Vec<Marginal>,
    side: usize,
) -> Result<Option<PriorRow>> {
    let d = posterior.constants();
    let other = posterior.with_marginals(marginals);
    let (centre, sd) = other.start();
    let mode = laplace(&other.untruncated(), &centre, &sd)?;
    let sd: Vec<f64> = (0..d)
        .map(|k| mode.covariance[k * other.dim() + k].sqrt())
        .collect();
    let bounds = automatic(&other, &mode.mode[..d], &sd);
    if bounds.iter().any(|[low, high]| low >= high) {
        return Ok(None);
    }
    let grid = PosteriorGrid::new(&other, &mode, &bounds, side)?;
    Ok(Some(PriorRow {
        prior,
        moments: grid.moments,
    }))
}
