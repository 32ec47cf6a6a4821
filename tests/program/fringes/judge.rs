//! What measured displacements are worth, against the truth of every pixel.

use std::f64::consts::{PI, TAU};

use plychain::field::fringes::{Fringes, PhaseSteps};
use plychain::progress::Silent;

use super::camera::{Camera, Pictured};
use crate::common::fresh;

/// What one component's displacement is worth.
#[derive(Debug)]
pub struct Judged {
    /// rms error over the floor of the noise, and the rms of the stated sds over the rms error.
    pub over_floor: f64,
    pub sd_ratio: f64,
    /// Correlation of neighbours' errors.
    pub neighbours: f64,
    /// Pixels that are off by an order, shares of those that can be measured that are, and of the picture that is claimed without surface.
    pub off: usize,
    pub kept: f64,
    pub claimed: f64,
    pub steps: PhaseSteps,
}

/// Against the phase (rad) at each pixel, NaN where it cannot be measured.
pub fn judge(
    fringes: &Fringes,
    c: usize,
    truth: &[f64],
    floor: f64,
    surface: &dyn Fn(usize) -> bool,
) -> Judged {
    let own = &fringes.components[c];
    let scale = TAU * fringes.spec.fringe_frequency_per_mm;
    let claimed = (0..truth.len()).filter(|&i| own.displacement_mm[i].is_finite() && !surface(i));
    let able = truth.iter().filter(|t| t.is_finite()).count();
    let mut errors: Vec<(usize, f64, f64)> = (0..truth.len())
        .map(|i| {
            (
                i,
                own.displacement_mm[i] * scale - truth[i],
                own.sd_mm[i] * scale,
            )
        })
        .filter(|(_, e, _)| e.is_finite())
        .collect();
    let mut sorted: Vec<f64> = errors.iter().map(|e| e.1).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let kept = errors.len();
    errors.retain(|e| (e.1 - middle).abs() < PI);
    let off = kept - errors.len();
    let n = errors.len() as f64;
    let mean = errors.iter().map(|e| e.1).sum::<f64>() / n;
    errors.iter_mut().for_each(|e| e.1 -= mean);
    let variance = errors.iter().map(|e| e.1 * e.1).sum::<f64>() / n;
    let stated = errors.iter().map(|e| e.2 * e.2).sum::<f64>() / n;
    let pairs = errors.windows(2).filter(|p| p[1].0 == p[0].0 + 1);
    let (product, count) = pairs.fold((0.0, 0.0), |(s, n), p| (s + p[0].1 * p[1].1, n + 1.0));
    Judged {
        over_floor: variance.sqrt() / floor,
        sd_ratio: (stated / variance).sqrt(),
        neighbours: product / count / variance,
        off,
        kept: kept as f64 / able as f64,
        claimed: claimed.count() as f64 / truth.len() as f64,
        steps: own.chosen.steps,
    }
}

pub fn measured(pictured: &Pictured) -> [Judged; 2] {
    let fringes = Fringes::measure(&pictured.file, &Silent).unwrap();
    [0, 1].map(|c| {
        judge(&fringes, c, &pictured.phase[c], pictured.floor[c], &|i| {
            pictured.surface[i]
        })
    })
}

/// Errors of at most `most` floors, with all that goes with them.
pub fn check(case: &str, judged: &Judged, most: f64) {
    println!("{case}: {judged:?}");
    assert!(judged.over_floor < most, "{case}: {judged:?}");
    assert!((judged.sd_ratio - 1.0).abs() < 0.15, "{case}: {judged:?}");
    assert!(judged.neighbours.abs() < 0.05, "{case}: {judged:?}");
    assert_eq!(judged.off, 0, "{case}: {judged:?}");
    assert!(
        judged.kept > 0.99 && judged.claimed < 2e-4,
        "{case}: {judged:?}"
    );
}

pub fn taken(name: &str, camera: &Camera, seed: u64) -> Pictured {
    camera.take(&fresh(&format!("fringes-{name}-{seed}")), seed)
}
