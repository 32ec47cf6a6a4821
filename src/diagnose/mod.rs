//! Convergence diagnostics: R-hat, effective sample sizes, Monte Carlo standard errors, autocorrelation times, and the
//! verdict that stops a run.
//!
//! Conventions, kept here alone: an estimate is NaN if any value is NaN or infinite, if the values of every ensemble are
//! equal (nothing is known of how a constant mixes), or if there are fewer than four draws a chain; the verdict reads NaN as not
//! converged.

mod autocov;
mod burn_in;
mod ess;
mod importance;
mod mcse;
mod rhat;
mod tau;
mod transform;
mod transitions;
mod verdict;

pub use burn_in::joined;
pub use ess::{ess_bulk, ess_mean, ess_quantile, ess_tail};
pub use importance::{Weighed, weigh};
pub use mcse::{mcse_mean, mcse_quantile, mcse_sd};
pub use rhat::rhat;
pub use tau::tau;
pub use transform::{mean, sd, sorted};
pub use transitions::{TransitionFault, transitions};
pub use verdict::{Row, Rule, Verdict, diagnose};

use crate::chain::ScalarDraws;

/// Fewest draws of a chain that say anything of its autocorrelation.
const FEWEST: usize = 4;

/// Whether a series has anything to estimate from; see the conventions of this module.
fn usable(series: &ScalarDraws) -> bool {
    let values = &series.values;
    series.draws >= FEWEST
        && values.iter().all(|v| v.is_finite())
        && series.groups().iter().any(|chains| {
            let first = series.chain(chains[0])[0];
            chains
                .iter()
                .any(|&c| series.chain(c).iter().any(|v| *v != first))
        })
}
