//! Parts of a series' residual in which patches are sought: what grows with the load, what all frames share, and each frame's own.
//!
//! With f the loads over the largest: the load part has the weights w = (f - mean f) / sum (f - mean f)^2, the common one 1 / n - mean(f) w,
//! which is the intercept at zero load, and a frame's own a row of I - H, H the projector on (1, f). Each part is one field of the shape of
//! one frame's noise, of some scale.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// In which part of a series a patch is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchPart {
    /// It grows with the load: it is on the specimen.
    Load,
    /// All frames share it: it is the reference picture's.
    Common,
    /// One frame has it, by its number from 0.
    Own(usize),
    /// It is in one field, or in all frames of one load: nothing tells whose it is.
    Whole,
}

/// A weighted sum of the frames.
pub(super) struct FramePart {
    pub part: PatchPart,
    pub weights: DVector<f64>,
    /// Variance of its noise over that of a frame of scale 1.
    pub scale: f64,
    /// What a patch of unit amplitude leaves in it.
    pub share: f64,
}

/// Loads that vary by less than this part of the largest do not tell a constant from what grows with the load.
const VARIES: f64 = 0.05;

/// All parts of frames of the noise scales `scales`, whose reference picture has the share `reference` of the noise.
pub(super) fn parts(loads: &[f64], scales: &[f64], reference: f64) -> Vec<FramePart> {
    let n = loads.len();
    let count = n as f64;
    let mean = loads.iter().sum::<f64>() / count;
    let about = DVector::from_iterator(n, loads.iter().map(|f| f - mean));
    let largest = loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let varies = (about.norm_squared() / count).sqrt() > VARIES * largest;
    let variance = |w: &DVector<f64>| {
        let own: f64 = w.iter().zip(scales).map(|(w, d)| w * w * d).sum();
        own + reference * w.sum().powi(2)
    };
    let made = |part: PatchPart, weights: DVector<f64>, share: f64| FramePart {
        scale: variance(&weights),
        part,
        weights,
        share,
    };
    let even = DVector::repeat(n, 1.0 / count);
    let mut laws = DMatrix::from_columns(&[DVector::repeat(n, 1.0 / count.sqrt())]);
    let mut all = Vec::new();
    if varies {
        let with_load = &about / about.norm_squared();
        laws = laws.insert_column(1, 0.0);
        laws.set_column(1, &about.normalize());
        all.push(made(PatchPart::Common, &even - mean * &with_load, 1.0));
        all.insert(0, made(PatchPart::Load, with_load, 1.0));
    } else {
        // of one load nothing tells the specimen from the reference picture
        all.push(made(PatchPart::Whole, even, 1.0));
    }
    let own = DMatrix::identity(n, n) - &laws * laws.transpose();
    for t in (0..n).filter(|t| own[(*t, *t)] > SEEN) {
        let row = own.row(t).transpose();
        all.push(made(PatchPart::Own(t), row, own[(t, t)]));
    }
    all
}

/// Less than this of a frame beside what follows the laws is nothing of its own.
const SEEN: f64 = 0.02;

/// The part that is largest over its noise in what is left of all frames, nm: by blocks, of frames of these loads and noise scales.
pub(in crate::trace) fn largest_part(
    left_nm: &[[Vec<f64>; 2]],
    loads: &[f64],
    scales: &[f64],
) -> Option<PatchPart> {
    let size = |part: &FramePart| -> f64 {
        let one = |c: usize, block: usize| {
            let frames = part.weights.iter().zip(left_nm);
            frames.map(|(w, left)| w * left[c][block]).sum::<f64>()
        };
        let blocks = left_nm.first().map_or(0, |left| left[0].len());
        let squares = (0..2).flat_map(|c| (0..blocks).map(move |b| (c, b)));
        squares.map(|(c, b)| one(c, b).powi(2)).sum::<f64>() / part.scale
    };
    // the reference picture is as noisy as the others
    let sizes = parts(loads, scales, 1.0).into_iter();
    let sizes = sizes.map(|part| (size(&part), part.part));
    sizes
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, part)| part)
}

#[cfg(test)]
#[path = "../../../tests/unit/parts.rs"]
mod tests;
