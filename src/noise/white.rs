//! The white noise of a field from what its neighbours cannot predict, independent of any model.

use rayon::prelude::*;

use crate::field::Field;
use crate::field::local::{LocalFit, NEIGHBOURS, mad};

/// Sds beyond which a residual does not count.
const CUT: f64 = 3.0;
/// How far, in cuts, tails are looked at: farther are jumps.
const TAILS: f64 = 2.5;
/// E[z^2 | |z| < [`CUT`]] of the standard normal.
const KEPT: f64 = 0.973_336_9;

/// The sd of a single point's white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoise {
    /// Sd of (u1, u2) in mm.
    pub sd_mm: [f64; 2],
    /// Standard error of these sds over the sds themselves.
    pub relative_error: f64,
    /// Logarithm of the variance within `TAILS` times `CUT` over these squared: above 0 where the noise has heavier tails than a normal one.
    pub tails: [f64; 2],
    /// How many points were used.
    pub points: usize,
}

/// Estimate the white noise of `field` from the residuals of local quadratic fits, each scaled by its leverage. Their
/// variance is that of the residuals within three standard deviations, made consistent for the normal
/// distribution, so that outliers, fringe-order jumps and the strongest gradients do not enter. Smooth
/// structure and noise correlated over many spacings are not seen; noise correlated over few is, in part.
pub fn white(field: &Field) -> WhiteNoise {
    /// Enough for a standard error of 0.4 %.
    const MOST: usize = 60_000;
    let fits = LocalFit::new(&field.points, &field.displacement);
    // an odd stride wanders through the columns of most grids
    let stride = (field.len() / MOST) | 1;
    let stride = if field.len() <= MOST {
        1
    } else {
        stride.max(3)
    };
    let centers: Vec<usize> = (0..field.len()).step_by(stride).collect();
    let weights = field.weights();
    // residuals of points that are worth less are larger: those of a point of mean variance
    let root = |i: usize| weights.as_ref().map_or(1.0, |w| w[i].sqrt());
    let scaled: Vec<[f64; 2]> = centers
        .par_iter()
        .map(|&i| {
            let (residual, widening) = fits.residual(i);
            residual.map(|r| r * root(i) / widening)
        })
        .collect();
    let sd_mm = [0, 1].map(|k| truncated_sd(&scaled.iter().map(|r| r[k]).collect::<Vec<_>>()));
    let tails = [0, 1].map(|k: usize| {
        let reach = TAILS * CUT * sd_mm[k];
        let squares = scaled.iter().map(|r| r[k]).filter(|r| r.abs() <= reach);
        let (count, sum) = squares.fold((0_usize, 0.0), |(n, s), r| (n + 1, s + r * r));
        let variance = sum / count.max(1) as f64;
        if variance > 0.0 {
            (variance / (sd_mm[k] * sd_mm[k])).ln().max(0.0)
        } else {
            0.0
        }
    });
    // on a lattice neighbouring residuals share points (half as much variance again as of as many independent ones),
    // and what is cut at three sd costs a sixth more
    let n = centers.len().max(NEIGHBOURS) as f64;
    WhiteNoise {
        sd_mm,
        relative_error: (1.75 / (2.0 * n)).sqrt(),
        tails,
        points: centers.len(),
    }
}

/// Standard deviation about zero of normal `values` of which some are contaminated: iterated truncation at three sd.
pub(super) fn truncated_sd(values: &[f64]) -> f64 {
    let mut sd = mad(values.iter().copied());
    for _ in 0..30 {
        let (n, sum) = values
            .iter()
            .filter(|v| v.abs() <= CUT * sd)
            .fold((0_usize, 0.0), |(n, sum), v| (n + 1, sum + v * v));
        let next = (sum / (n.max(1) as f64) / KEPT).sqrt();
        if (next - sd).abs() <= 1e-12 * sd {
            break;
        }
        sd = next;
    }
    sd
}
