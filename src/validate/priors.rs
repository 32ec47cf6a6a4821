//! How far the posterior depends on the prior's cuts and means.

use super::article;
use super::grid::{PosteriorGrid, automatic};
use super::quadrature::GridMoments;
use crate::chain::Draws;
use crate::error::Result;
use crate::infer::Marginal;
use crate::posterior::PosteriorDensity;
use crate::sample::{LogDensity, laplace};

/// One choice of prior.
pub struct PriorRow {
    pub prior: String,
    pub moments: GridMoments,
}

/// Priors beside each other, and what a cut would cut off.
pub struct PriorTable {
    /// The declared prior first.
    pub rows: Vec<PriorRow>,
    /// The box of the cut, its name, and the share of the chain's draws outside of it.
    pub outside: Option<(String, Vec<[f64; 2]>, f64)>,
}

/// Posteriors under the declared prior, without cuts, cut at Table 5 and about Noh's values (if `published`).
///
/// # Errors
/// Those of a mode without maximum and of the grid.
pub fn compare(
    posterior: &PosteriorDensity,
    side: usize,
    published: bool,
    draws: &Draws,
) -> Result<PriorTable> {
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
    let bounds = if published {
        Some(("Table 5".to_string(), article::TRUNCATION.to_vec()))
    } else {
        let bounds = || declared.iter().map(Marginal::bounds).collect();
        cut.then(|| ("declared".into(), bounds()))
    };
    if published {
        choices.push((
            "truncated at Table 5".into(),
            with(&|k, m| m.truncate = article::TRUNCATION.get(k).copied().or(m.truncate)),
        ));
        choices.push((
            "mean of Noh (Table 1)".into(),
            with(&|k, m| m.mean = article::NOH.get(k).copied().unwrap_or(m.mean)),
        ));
    }
    let rows = choices
        .into_iter()
        .filter_map(|(prior, marginals)| row(posterior, prior, marginals, side).transpose())
        .collect::<Result<Vec<_>>>()?;
    let outside = bounds.map(|(name, bounds)| {
        let inside = |x: &[f64]| {
            bounds
                .iter()
                .zip(x)
                .all(|([low, high], x)| (low..=high).contains(&x))
        };
        let out = draws.points().filter(|x| !inside(x)).count();
        (name, bounds, out as f64 / draws.len().max(1) as f64)
    });
    Ok(PriorTable { rows, outside })
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
