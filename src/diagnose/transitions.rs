//! What a Hamiltonian sampler says of its own transitions, judged as CmdStan's `diagnose` does.

use super::transform::mean;
use crate::chain::Draws;

/// E-BFMI below which a chain explores the energies too slowly (Betancourt 2016, arXiv:1604.00695; the limit of CmdStan).
const LEAST_EBFMI: f64 = 0.3;

/// A fault of the transitions: what was counted, and what it means.
pub struct TransitionFault {
    pub figure: String,
    pub meaning: &'static str,
}

/// Divergent transitions, trajectories that ended at the largest depth, energies that are explored too slowly.
pub fn transitions(draws: &Draws) -> Vec<TransitionFault> {
    let column = |name: &str| {
        let found = draws.info.columns.iter().find(|(n, _)| n == name);
        found
            .map(|(_, values)| values.as_slice())
            .unwrap_or_default()
    };
    let names = ["divergent__", "saturated__", "treedepth__", "energy__"];
    let [divergent, saturated, depth, energy] = names.map(column);
    let count = |marks: &[f64]| marks.iter().filter(|d| **d != 0.0).count();
    let mut faults = Vec::new();
    if count(divergent) > 0 {
        faults.push(TransitionFault {
            figure: format!(
                "{} of {} draws ended in a divergent transition",
                count(divergent),
                divergent.len()
            ),
            meaning: "the chains may miss a part of the posterior, whatever the figures say",
        });
    }
    if count(saturated) > 0 {
        let reached = depth.iter().zip(saturated).filter(|(_, s)| **s != 0.0);
        let limit = reached.map(|(depth, _)| *depth).fold(0.0, f64::max);
        faults.push(TransitionFault {
            figure: format!(
                "{} of {} draws hit max_depth{}",
                count(saturated),
                saturated.len(),
                if limit > 0.0 {
                    format!(" {limit}")
                } else {
                    String::new()
                }
            ),
            meaning: "the trajectories were cut short. Run again with a larger max_depth",
        });
    }
    let chains = energy.chunks(draws.draws().max(1));
    let figures: Vec<f64> = chains.filter(|e| e.len() > 1).map(ebfmi).collect();
    let low: Vec<f64> = figures
        .iter()
        .copied()
        .filter(|f| *f < LEAST_EBFMI)
        .collect();
    if !low.is_empty() {
        let least = low.iter().copied().fold(f64::INFINITY, f64::min);
        faults.push(TransitionFault {
            figure: format!(
                "E-BFMI is below {LEAST_EBFMI} in {} of {} chains (least {least:.2})",
                low.len(),
                figures.len()
            ),
            meaning: "the sampler explores the energies too slowly. Reparametrise the model",
        });
    }
    faults
}

/// Estimated Bayesian fraction of missing information of a chain: the mean square of the steps of its energy over the variance.
fn ebfmi(energy: &[f64]) -> f64 {
    let middle = mean(energy);
    let steps: f64 = energy.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    steps / energy.iter().map(|e| (e - middle).powi(2)).sum::<f64>()
}
