//! What the noise of a series is, in words.

use crate::noise::series::{Growth, SmoothKernel};
use crate::posterior::NoisePair;
use crate::posterior::Weighing;
use crate::quantity::UM_PER_MM;

/// Share of the reference picture in the likeliest noise without a discrepancy; 1 where all noise has one.
pub(super) fn reference(weighing: &Weighing) -> f64 {
    let Some(series) = weighing.noise.by_frames() else {
        return 1.0;
    };
    let plain = series.settings.iter().filter(|s| s.at.rival.is_none());
    let best = plain.max_by(|a, b| a.log_all.total_cmp(&b.log_all));
    best.map_or(1.0, |s| s.at.reference)
}

/// The smooth part of the noise of frames: its length, its sd, and whose it is. Nothing where there is none.
pub(super) fn noise_words(weighing: &Weighing, pair: &NoisePair) -> String {
    let Some(series) = weighing.noise.by_frames() else {
        return String::new();
    };
    let noise = &series.noise;
    let rival = series.settings[pair.of[0]].at.rival;
    let mut said = Vec::new();
    if noise.walks {
        said.push("The noise adds up from frame to frame, as where every picture is correlated with the one before. Correlate all with the first picture where you can.".into());
    }
    let smooth = noise.spatial.iter().filter(|n| n.shape.ratio > 0.0);
    let largest = smooth.max_by(|a, b| {
        let size = |n: &crate::noise::series::SpatialNoise| n.shape.ratio * n.scale2;
        size(a).total_cmp(&size(b))
    });
    if let Some(n) = largest.filter(|_| noise.is_smooth()) {
        let sd = [0, 1].map(|c: usize| {
            let n = &noise.spatial[c];
            (n.shape.ratio * n.scale2).sqrt() * UM_PER_MM
        });
        let like = match n.shape.kernel {
            SmoothKernel::SquaredExponential => "air or lights",
            SmoothKernel::Matern => "air, lights or the camera's own warmth",
        };
        said.push(format!(
            "The frames' noise is smooth over about {:.1} mm, and new in each frame, as {like} would leave. Its sd is {:.2} um in u1 and {:.2} um in u2.",
            n.shape.length_mm, sd[0], sd[1]
        ));
    }
    if let Some(rival) = rival.filter(|r| r.law == Growth::Constant) {
        said.push(format!(
            "All frames share a smooth pattern over about {:.1} mm: it is the reference picture's.",
            rival.length_mm
        ));
    }
    said.join(" ")
}
