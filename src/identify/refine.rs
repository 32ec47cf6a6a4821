//! Refinement of the reduced model where the posterior is.

use super::identification::Identification;
use super::inverse::Prepared;
use super::surrogate::TOLERANCE;
use crate::chain::Draws;
use crate::error::{Error, Result};
use crate::parameter::is_modulus;
use crate::progress::Progress;
use crate::reduce::{Dimension, Modes, Problem, ReducedModel, cache};

/// Half-width of the box about the posterior in standard deviations: a normal tail beyond it holds 4e-8.
const REACH_SDS: f64 = 5.5;

/// Room beyond the outermost draw, in standard deviations.
const MARGIN_SDS: f64 = 0.5;

/// A reduced model on a box about the draws, in place of the one they were drawn with, and with one mode more where
/// the error was above the tolerance.
///
/// All snapshots lie in that box. Those far away take modes and monomials from where the posterior is: for the open-hole
/// test on a coarse mesh with 4 modes, the largest field error near the posterior is 0.037 nm with 200 snapshots in the priors' box, 0.038
/// with 32 draws added to them, 0.034 with 200 points of the new box added, and 0.020 with those 200 alone. Draws among
/// the snapshots gain a tenth at most, so that they are left as points to check against.
pub fn enrich(
    found: &Identification,
    cache_dir: &std::path::Path,
    progress: &dyn Progress,
) -> Result<Prepared> {
    let prepared = &found.inverse.prepared;
    let modes = prepared.reduced.modes_per_component();
    let modes = modes.div_ceil(prepared.problem.families());
    let within = found.surrogate.max_sd() <= TOLERANCE;
    let modes = if within { modes } else { modes + 1 };
    let structural = found.inverse.posterior.structural();
    let dimensions = around(&prepared.problem, &found.draws, structural);
    let problem = prepared.problem.clone();
    let (reduced, problem, cached) = rebuilt(problem, dimensions, modes, cache_dir, progress)?;
    Ok(Prepared {
        problem,
        reduced,
        cached,
        observation: prepared.observation.clone(),
        discrepancy: prepared.discrepancy,
        traced: prepared.traced.clone(),
    })
}

/// The reduced model that a run was refined to, as its report has it: sides of the DoE box by name, and the modes kept.
///
/// # Errors
/// The input's fault, if the box is not of this model; those of finite-element solutions.
pub fn refined(
    prepared: Prepared,
    doe: &dyn Fn(&str) -> Option<[f64; 2]>,
    modes: usize,
    cache_dir: &std::path::Path,
    progress: &dyn Progress,
) -> Result<Prepared> {
    let mut dimensions = prepared.problem.dimensions.clone();
    for side in &mut dimensions {
        let [low, high] = doe(&side.name).ok_or_else(|| {
            Error::input("surrogate.refinement", "a box of the model's parameters")
                .found(format!("no {}", side.name))
        })?;
        (side.low, side.high) = (low, high);
    }
    let modes = modes.div_ceil(prepared.problem.families());
    let (reduced, problem, cached) =
        rebuilt(prepared.problem, dimensions, modes, cache_dir, progress)?;
    Ok(Prepared {
        problem,
        reduced,
        cached,
        ..prepared
    })
}

/// A reduced model of the problem on another box, with `modes` modes a family, and whether it was in the cache.
fn rebuilt(
    mut problem: Problem,
    dimensions: Vec<Dimension>,
    modes: usize,
    cache_dir: &std::path::Path,
    progress: &dyn Progress,
) -> Result<(ReducedModel, Problem, bool)> {
    problem.dimensions = dimensions;
    problem.spec.modes = Modes::Count(modes);
    problem.validate()?;
    let (reduced, cached) = cache::obtain(&problem, cache_dir, progress)?;
    Ok((reduced, problem, cached))
}

/// The box about the draws of the first `d` parameters; the thickness, which is not drawn, keeps its side.
fn around(problem: &Problem, draws: &Draws, d: usize) -> Vec<Dimension> {
    let n = draws.len() as f64;
    let mut dimensions = problem.dimensions.clone();
    for k in 0..d {
        let values = || draws.points().map(|x| x[k]);
        let mean = values().sum::<f64>() / n;
        let sd = (values().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        let (low, high) = values().fold((mean, mean), |(a, b), x| (a.min(x), b.max(x)));
        let side = &mut dimensions[k];
        side.low = (mean - REACH_SDS * sd).min(low - MARGIN_SDS * sd);
        side.high = (mean + REACH_SDS * sd).max(high + MARGIN_SDS * sd);
        if is_modulus(&side.name) {
            // Draws are positive; what lies below half the smallest of them is of no use.
            side.low = side.low.max(0.5 * low);
        }
    }
    dimensions
}
