//! Outliers: points that contradict all their neighbours, found without any model of the field.
//!
//! Each point is predicted by a quadratic through its nearest neighbours. It is an outlier where the residual exceeds
//! [`MULTIPLE`] standard deviations (a MAD, of the field or of the point's part of it, whichever is larger, widened
//! by the leverage) *and* hardly any neighbour shares the deviation: a region shifted by a fringe order is no outlier.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::local::{LocalFit, mad};
use super::measured::{Field, Reason, bounds};
use crate::numeric::median;

/// A residual beyond this many standard deviations makes an outlier (6e-7 of good Gaussian points).
pub const MULTIPLE: f64 = 5.0;
/// Least-squares residuals beyond this many standard deviations are looked at again, robustly.
const SUSPICIOUS: f64 = 3.0;
/// The next order of a local expansion may be this fraction of the quadratic one (strong gradients at the hole).
const NEXT_ORDER: f64 = 0.6;
/// This many neighbours that share a deviation make it a feature of the field.
const COMPANIONS: usize = 4;
/// Points in the parts of the field that have a scale of their own.
const PART: usize = 400;

/// Which components of a point are outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the point.
    pub point: usize,
    /// Whether u1 and u2 are outliers.
    pub component: [bool; 2],
}

/// Drop the outliers of `field`, count them, and return how many there were.
pub fn reject(field: &mut Field) -> usize {
    let mut keep = vec![true; field.len()];
    for outlier in outliers(&field.points, &field.displacement) {
        keep[outlier.point] = false;
    }
    field.retain(Reason::Outlier, |i| keep[i])
}

/// The outliers among `displacement` (u1, u2) at `points` (s, t), by increasing index of the point.
///
/// Outliers that are found no longer count as neighbours, which may unmask others: the suspicious points are looked
/// at again until no more are found.
pub fn outliers(points: &[[f64; 2]], displacement: &[[f64; 2]]) -> Vec<Outlier> {
    let fits = LocalFit::new(points, displacement);
    let residuals: Vec<([f64; 2], f64)> = (0..points.len())
        .into_par_iter()
        .map(|i| fits.residual(i))
        .collect();
    found(fits, points, displacement, &residuals)
}

/// The outliers of each of several displacements at the same points: the neighbours of a point are sought once.
pub fn outliers_of_steps(points: &[[f64; 2]], steps: &[&[[f64; 2]]]) -> Vec<Vec<Outlier>> {
    let fits = LocalFit::new(points, &[]);
    let residuals: Vec<(Vec<[f64; 2]>, f64)> = (0..points.len())
        .into_par_iter()
        .map(|i| fits.residuals(i, steps))
        .collect();
    let of_step = |(k, step): (usize, &&[[f64; 2]])| {
        let own: Vec<_> = residuals.iter().map(|(r, w)| (r[k], *w)).collect();
        found(fits.of(step), points, step, &own)
    };
    steps.par_iter().enumerate().map(of_step).collect()
}

/// The outliers among points with these least-squares residuals.
fn found(
    mut fits: LocalFit,
    points: &[[f64; 2]],
    displacement: &[[f64; 2]],
    residuals: &[([f64; 2], f64)],
) -> Vec<Outlier> {
    const ROUNDS: usize = 6;
    let scales = [0, 1].map(|k| scales(points, displacement, residuals, k));
    let suspicious =
        |i: usize, k: usize| residuals[i].0[k].abs() > SUSPICIOUS * scales[k][i] * residuals[i].1;
    let mut candidates: Vec<usize> = (0..points.len())
        .filter(|&i| suspicious(i, 0) || suspicious(i, 1))
        .collect();
    let mut found: Vec<Outlier> = Vec::new();
    for _ in 0..ROUNDS {
        let outliers: Vec<Outlier> = candidates
            .par_iter()
            .filter_map(|&point| {
                let component = [0, 1]
                    .map(|k| suspicious(point, k) && is_spike(&fits, point, k, scales[k][point]));
                component
                    .contains(&true)
                    .then_some(Outlier { point, component })
            })
            .collect();
        if outliers.is_empty() {
            break;
        }
        outliers
            .iter()
            .for_each(|outlier| fits.excluded[outlier.point] = true);
        candidates.retain(|&i| !fits.excluded[i]);
        found.extend(outliers);
    }
    found.sort_unstable_by_key(|outlier| outlier.point);
    found
}

/// The sd of component `k` at each point: the field's, or that of the point's part of it if that is larger.
fn scales(
    points: &[[f64; 2]],
    displacement: &[[f64; 2]],
    residuals: &[([f64; 2], f64)],
    k: usize,
) -> Vec<f64> {
    let scaled = |i: usize| residuals[i].0[k] / residuals[i].1;
    // exact data have no scale: do not chase rounding
    let largest = displacement
        .iter()
        .map(|u| u[k].abs())
        .fold(f64::MIN_POSITIVE, f64::max);
    let whole = mad((0..points.len()).map(scaled)).max(1e-9 * largest);
    let [low, high] = bounds(points);
    let parts = (points.len() as f64 / PART as f64).max(1.0);
    let side = ((high[0] - low[0]) * (high[1] - low[1]) / parts).sqrt();
    if side.is_nan() || side <= 0.0 {
        return vec![whole; points.len()];
    }
    let part_of = |p: &[f64; 2]| [0, 1].map(|k| ((p[k] - low[k]) / side) as u32);
    let mut members: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (i, p) in points.iter().enumerate() {
        members.entry(part_of(p)).or_default().push(i);
    }
    let mut scales = vec![whole; points.len()];
    for part in members.values().filter(|part| part.len() >= PART / 4) {
        let own = mad(part.iter().map(|&i| scaled(i)));
        part.iter().for_each(|&i| scales[i] = own.max(whole));
    }
    scales
}

/// Whether point `i` contradicts a robust fit of its neighbours, and does so alone.
fn is_spike(fits: &LocalFit, i: usize, k: usize, scale: f64) -> bool {
    let fit = fits.robust(i, k, scale);
    let excess = fit.residual.abs() - MULTIPLE * scale * fit.widening;
    let shared = |r: &&f64| (**r / fit.residual - 1.0).abs() < 0.5;
    excess > 0.0
        && fit.neighbours.iter().filter(shared).count() < COMPANIONS
        && excess > NEXT_ORDER * curvature(fits, i, k, scale).min(fit.curvature)
        && !fits.joins_one_side(i, k, scale, SUSPICIOUS)
}

/// Curvature of the field about point `i` as its nearest neighbours see it, each from its own fit: a cluster of outliers
/// bends one fit but hardly the median of several.
fn curvature(fits: &LocalFit, i: usize, k: usize, scale: f64) -> f64 {
    const WITNESSES: usize = 8;
    let near = fits.neighbourhood(i);
    let mut seen: Vec<f64> = near
        .index
        .iter()
        .take(WITNESSES)
        .map(|&j| fits.robust(j, k, scale).curvature)
        .collect();
    median(&mut seen)
}
