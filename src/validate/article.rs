//! Published figures of Gogu et al., Experimental Mechanics 53 (2013), and the article's setting on a simulated specimen.

use std::path::Path;

use super::drawn::simulated_at;
use super::grid::PosteriorGrid;
use super::quadrature::GridMoments;
use crate::error::{Error, Result};
use crate::experiment::simulate::Truth;
use crate::identify::{inverse_problem, prepare, start};
use crate::infer::Model;
use crate::progress::Progress;

/// Names of the four constants.
pub const NAMES: [&str; 4] = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"];

/// Table 1: values of Noh from a four-point bending test of the same prepreg roll.
pub const NOH: [f64; 4] = [144.0, 7.99, 0.34, 7.78];

/// Table 5: truncation bounds of the prior.
pub const TRUNCATION: [[f64; 2]; 4] = [[118.0, 162.0], [6.0, 9.5], [0.26, 0.36], [4.25, 5.75]];

/// Table 6: mean of the identified distribution.
pub const MEAN: [f64; 4] = [140.0, 7.48, 0.33, 5.02];

/// Table 6: coefficient of variation, %.
pub const COV_PERCENT: [f64; 4] = [3.3, 9.5, 10.3, 4.3];

/// Table 7: correlation.
pub const CORRELATION: [[f64; 4]; 4] = [
    [1.0, 0.023, -0.043, 0.51],
    [0.023, 1.0, -0.005, -0.17],
    [-0.043, -0.005, 1.0, 0.24],
    [0.51, -0.17, 0.24, 1.0],
];

/// Table 4: sd of the priors.
pub const PRIOR_SD: [f64; 4] = [16.0, 0.75, 0.03, 0.5];

/// Noise of the simulated specimen, nm, and points along a side.
const NOISE_NM: f64 = 10.0;
const GRID: usize = 121;

/// The article's setting: its specimen simulated at the means of Table 6 and written at `place`, priors of Table 4 cut at Table 5, 0.4 % of
/// unnamed error, a grid over the cut.
///
/// # Errors
/// Of the input: a model of another kind. Those of simulation, of the inverse problem and of the grid.
pub fn repeated(
    model: &Model,
    (seed, nodes): (u64, usize),
    (cache, place): (&Path, &Path),
    progress: &dyn Progress,
) -> Result<GridMoments> {
    if model.constants() != NAMES || !model.sampled().is_empty() {
        return Err(Error::input(
            "--article",
            "a laminate without mechanical effects, as the article's",
        )
        .found(&model.file.name)
        .hint("use models/openhole.json"));
    }
    let truth = Truth {
        constants: MEAN.to_vec(),
        thickness_mm: model.experiment().specimen.thickness_mm.mean,
        effects: Vec::new(),
        noise_nm: NOISE_NM,
        correlation_mm: 0.0,
        grid: GRID,
        seed,
    };
    let model = &simulated_at(model, &truth, place)?;
    let prepared = prepare(model, cache, progress)?;
    let posterior = inverse_problem(model, prepared, progress)?.posed.density;
    let mut marginals = posterior.marginals().to_vec();
    for (m, cut) in marginals.iter_mut().zip(TRUNCATION) {
        m.truncate = Some(cut);
    }
    let mode = start(&posterior)?;
    let posterior = posterior.with_marginals(marginals);
    Ok(PosteriorGrid::new(&posterior, &mode, &TRUNCATION, nodes)?.moments)
}

/// What the published figures cannot be compared with, in sentences.
pub fn caveats() -> Vec<String> {
    vec![
        format!(
            "The published sd of nu12, {:.3}, exceeds that of its own prior, {:.2}. No data can widen a prior so, least of all a truncated one.",
            MEAN[2] * COV_PERCENT[2] / 100.0,
            PRIOR_SD[2]
        ),
        "The published grid was converged to 1 % in the means, 8 % in the sd and 10 % in the correlations.".into(),
        "The published sd are of measured fields. Their noise and gauge are not stated, and the specimen's drawing is missing. Length, width and hole are assumed here.".into(),
    ]
}
