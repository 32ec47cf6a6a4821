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
pub struct FramePart {
    pub part: PatchPart,
    pub weights: DVector<f64>,
    /// Variance of its noise over that of a frame of scale 1.
    pub scale: f64,
    /// What a patch of unit amplitude leaves in it.
    pub share: f64,
}

/// Loads that vary by less than this part of the largest do not tell a constant from what grows with the load.
const VARIES: f64 = 0.05;

/// Whether loads tell a constant from what grows with the load.
fn vary(loads: &[f64]) -> bool {
    let count = loads.len() as f64;
    let mean = loads.iter().sum::<f64>() / count;
    let square: f64 = loads.iter().map(|f| (f - mean).powi(2)).sum();
    let largest = loads.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    (square / count).sqrt() > VARIES * largest
}

/// All parts of frames of the noise scales `scales`, whose reference picture has the share `reference` of the noise.
pub fn parts(loads: &[f64], scales: &[f64], reference: f64) -> Vec<FramePart> {
    let n = loads.len();
    let count = n as f64;
    let mean = loads.iter().sum::<f64>() / count;
    let about = DVector::from_iterator(n, loads.iter().map(|f| f - mean));
    let varies = vary(loads);
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

/// The part that explains most, and more than half, of what is left of all frames, nm: by blocks, of frames of these loads and noise scales. Each
/// is taken alone, as one field times the loads, in all frames or in one, under noise of which the reference picture has as much as a frame.
pub fn largest_part(left_nm: &[[Vec<f64>; 2]], loads: &[f64], scales: &[f64]) -> Option<PatchPart> {
    if !vary(loads) {
        return None;
    }
    let n = loads.len();
    let noise = DMatrix::from_fn(n, n, |i, j| 1.0 + if i == j { scales[i] } else { 0.0 });
    let noise = noise.cholesky()?;
    let single = DMatrix::<f64>::identity(n, n);
    let own = (0..n).map(|t| (PatchPart::Own(t), single.column(t).into_owned()));
    let common = (PatchPart::Common, DVector::repeat(n, 1.0));
    let load = (PatchPart::Load, DVector::from_column_slice(loads));
    let blocks = left_nm.first().map_or(0, |left| left[0].len());
    let left = DMatrix::from_fn(n, 2 * blocks, |k, b| left_nm[k][b / blocks][b % blocks]);
    let weighted = noise.solve(&left);
    let all = left.dot(&weighted);
    let explained = |law: &DVector<f64>| {
        let along = weighted.tr_mul(law);
        along.norm_squared() / law.dot(&noise.solve(law))
    };
    let parts = own.chain([common, load]);
    let sizes = parts.map(|(part, law)| (explained(&law), part));
    let most = sizes.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (most.0 > 0.5 * all).then_some(most.1)
}
