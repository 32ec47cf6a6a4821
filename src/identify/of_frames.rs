//! The noise of the one field of a load series, as its frames measure it: there smooth patterns are noise that one field takes for mechanics.

use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::field::Blocks;
use crate::infer::{Observation, Steps, UnitColumns};
use crate::linearise::relative;
use crate::noise::Noise;
use crate::noise::series::{FrameNoise, Frames, found_noise};

/// Blocks on which smooth patterns are looked for: they are several blocks long, and what is not there need not be measured well.
const COARSE: f64 = 200.0;

/// The noise of what grows with the load in a series whose frames have smooth patterns of their own, with the length of those, mm; else what
/// it was. Frames are free to move, and to differ by whatever the modes and the declared effects may do.
///
/// # Errors
/// Of the program: a factorisation that fails.
pub fn measured_by_frames(
    noise: Noise,
    observation: &Observation,
    columns: &UnitColumns,
) -> Result<(Noise, Option<f64>)> {
    let Some(steps) = &observation.steps else {
        return Ok((noise, None));
    };
    let loads = relative(&steps.loads);
    let smooth = |blocks: &Blocks| -> Result<Option<FrameNoise>> {
        let frames = Frames {
            blocks,
            loads: loads.clone(),
            subset_mm: observation.field.subset_mm,
        };
        if frames.len() <= frames.laws().len() {
            return Ok(None);
        }
        let values = [0, 1].map(|c| in_frames(blocks, observation, steps, columns, c));
        if values[0].ncols() >= values[0].nrows() / 2 {
            return Ok(None);
        }
        let found = found_noise(&frames, [&values[0], &values[1]], &|| ())?.over(&frames)?;
        Ok(Some(found).filter(FrameNoise::is_smooth))
    };
    let coarser = (noise.blocks.len() as f64 / COARSE).sqrt();
    if coarser > 1.0 {
        let coarse = Blocks::new(&observation.field, coarser * noise.blocks.size_mm, |_| true);
        if smooth(&coarse)?.is_none() {
            return Ok((noise, None));
        }
    }
    let Some(frames) = smooth(&noise.blocks)? else {
        return Ok((noise, None));
    };
    let weights = DVector::from_vec(steps.weights());
    // where the weights do not sum to nothing, the reference picture's noise is in the field too
    let share = weights.dot(&(frames.of_frames(1.0) * &weights));
    let subset = observation.field.subset_mm.is_some();
    let smooth = frames.spatial.iter().filter(|s| s.ratio > 0.0);
    let length = smooth.fold(0.0_f64, |longest, s| longest.max(s.length_mm));
    Ok((as_measured(noise, &frames, share, subset), Some(length)))
}

/// The noise as frames measure it, in a sum of frames that has `share` times the variance of one; where a subset is declared, it correlates
/// the noise of points.
fn as_measured(mut noise: Noise, frames: &FrameNoise, share: f64, subset: bool) -> Noise {
    for (c, frame) in frames.spatial.iter().enumerate() {
        let count = noise.reml[c].mean_count;
        let point = if subset { 1.0 } else { count };
        let scale2 = share * frame.scale2;
        let best = &mut noise.reml[c].best;
        best.length_mm = frame.length_mm;
        best.ratio = frame.ratio * count / point;
        best.scale2 = scale2 * point / count;
        noise.log_variance[c].0 = (scale2 * (point + frame.ratio)).ln();
        noise.covariance[c] = (*frame.covariance).clone();
        noise.scale2[c] = scale2;
    }
    noise.effective_points = noise.covariance.iter().map(|c| c.effective_points()).sum();
    noise
}

/// One component of what each frame may do, every column in one frame, and last what it measured without its motion: frames x blocks, mm.
fn in_frames(
    blocks: &Blocks,
    observation: &Observation,
    steps: &Steps,
    columns: &UnitColumns,
    c: usize,
) -> DMatrix<f64> {
    let points = &observation.field.points;
    let average = |field: &[[f64; 2]]| {
        let values: Vec<f64> = field.iter().map(|u| u[c]).collect();
        blocks.average(&values)
    };
    let motions = |&[s, t]: &[f64; 2]| [[1.0, 0.0], [0.0, 1.0], [-t, s]];
    let moved = [0, 1, 2].map(|k| points.iter().map(|p| motions(p)[k]).collect::<Vec<_>>());
    let fields = columns.modes.iter().chain(&columns.effects).chain(&moved);
    let fields: Vec<DVector<f64>> = fields.map(|f| average(f)).collect();
    let (n, p, count) = (blocks.len(), fields.len(), steps.loads.len());
    let mut all = DMatrix::zeros(count * n, count * p + 1);
    for s in 0..count {
        for (k, field) in fields.iter().enumerate() {
            all.view_mut((s * n, s * p + k), (n, 1)).copy_from(field);
        }
        let measured = average(&steps.strained(points, s));
        all.view_mut((s * n, count * p), (n, 1))
            .copy_from(&measured);
    }
    all
}
