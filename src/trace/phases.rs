//! Whether a wave of the exported displacement has another phase in each step of a series.
//!
//! Where the file's own scale holds a gain that the wave's argument did not see, the argument is off by the gain times the motion: .07 px at
//! .3 % and 25 px. Phases that are not needed cost a third of the precision of a gain (prototype study): they must gain some nats.

use super::evidence::Evidence;
use crate::error::Result;
use crate::linearise::Column;
use crate::noise::NormalEquations;
use crate::posterior::with_data;

/// Log evidence that the phases of all steps together must gain.
const LEAST_GAIN: f64 = 3.0;

const SHIFTED: &str = "In each picture the interpolation wave is shifted by another part of a pixel. plychain estimates this shift for each picture.";

/// The shifts of a wave in each step (px, along the data's axes), by the columns of its `phases`; none where these do not gain enough
/// beside the best subset, under the likeliest noise.
///
/// # Errors
/// Of the program: a factorisation that fails.
pub(super) fn shifts(evidence: &Evidence, phases: &[Column]) -> Result<Vec<[f64; 2]>> {
    if phases.is_empty() {
        return Ok(Vec::new());
    }
    let mut all = evidence.with_best();
    let without = all.base.len();
    all.base.extend_from_slice(phases);
    all.candidates.clear();
    all.near_edge.clear();
    let with = all.base.len();
    let columns = [0, 1].map(|c| with_data(&evidence.measured, &all, c));
    let pair = evidence.weighing.pairs[evidence.subsets.best_pair];
    let noise = &evidence.weighing.noise;
    let gram = noise.grams(&evidence.measured.blocks, columns.each_ref(), &[pair])?;
    let fit = |n: usize| {
        let mut inside = gram[0].view((0, 0), (n, n)).into_owned();
        let mut right = gram[0].view((0, with), (n, 1)).column(0).into_owned();
        all.add_known(&mut inside, &mut right);
        NormalEquations::with_unit_prior(inside, right)
    };
    let gains = |(fit, other): &(NormalEquations, NormalEquations)| {
        fit.log_evidence() - other.log_evidence() > LEAST_GAIN
    };
    let Some((fit, _)) = fit(with).zip(fit(without)).filter(gains) else {
        return Ok(Vec::new());
    };
    let mean = fit.mean();
    let shift = |(k, c): (usize, &Column)| c.mean + c.sd * mean[without + k];
    let shifts: Vec<f64> = phases.iter().enumerate().map(shift).collect();
    Ok(shifts.chunks_exact(2).map(|s| [s[0], s[1]]).collect())
}

/// What is to be said of phases that take part.
pub(super) fn phase_words(evidence: &Evidence) -> Option<String> {
    let mut base = evidence.sensitivities.base.iter();
    base.any(Column::is_phase).then(|| SHIFTED.into())
}
