//! Points that stand in a measurement more than once count once, with the mean of what was measured there: copies are no measurements.

use std::collections::HashMap;

use super::common::PointIndex;
use super::measured::{Field, Reason, bounds};

/// Points with one and the same displacement are copies of one if they lie within this many spacings of the file's points.
const NEAR: f64 = 8.0;

/// A measurement was copied where this share of its points is in groups of one size: equal displacements that are rounded are not.
const MOST: f64 = 0.5;

/// Merge the points of `field` at the same place, and those that a coarser measurement was copied to, count those that went, and return
/// how many.
pub(super) fn merge(field: &mut Field) -> usize {
    let [low, high] = bounds(&field.points);
    let area: f64 = (0..2).map(|k| high[k] - low[k]).product();
    // copies make this too small, never too large
    let spacing = (area / field.len().max(1) as f64).sqrt();
    let same = PointIndex::new(&field.points, spacing).first_at_each();
    let again = merge_to(field, &same);
    again + merge_to(field, &copies(field, NEAR * spacing))
}

/// For each point the first one of which it is a copy: of the same displacement, bit for bit, and not farther away than `reach_mm`.
fn copies(field: &Field, reach_mm: f64) -> Vec<usize> {
    let mut groups: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (i, u) in field.displacement.iter().enumerate() {
        groups.entry(u.map(f64::to_bits)).or_default().push(i);
    }
    let is_near = |group: &&Vec<usize>| {
        let places: Vec<[f64; 2]> = group.iter().map(|&i| field.points[i]).collect();
        let [low, high] = bounds(&places);
        (0..2).all(|k| high[k] - low[k] < reach_mm)
    };
    let copied = groups.values().filter(|g| g.len() > 1).filter(is_near);
    let copied: Vec<&Vec<usize>> = copied.collect();
    let mut of_size: HashMap<usize, usize> = HashMap::new();
    for group in &copied {
        *of_size.entry(group.len()).or_default() += group.len();
    }
    let most = of_size.values().copied().max().unwrap_or(0);
    let mut first: Vec<usize> = (0..field.len()).collect();
    if most as f64 > MOST * field.len() as f64 {
        for group in copied {
            group.iter().for_each(|&i| first[i] = group[0]);
        }
    }
    first
}

/// Merge points into the `first` of theirs: means of places and displacements.
fn merge_to(field: &mut Field, first: &[usize]) -> usize {
    let is_first = |i: usize| first[i] == i;
    if (0..field.len()).all(is_first) {
        return 0;
    }
    let mut sums = vec![([0.0; 4], 0.0); field.len()];
    for ((p, u), &i) in field.points.iter().zip(&field.displacement).zip(first) {
        let values = [p[0], p[1], u[0], u[1]];
        (0..4).for_each(|k| sums[i].0[k] += values[k]);
        sums[i].1 += 1.0;
    }
    for (i, ([s, t, u, v], n)) in sums.into_iter().enumerate() {
        if n > 1.0 {
            field.points[i] = [s / n, t / n];
            field.displacement[i] = [u / n, v / n];
        }
    }
    field.retain(Reason::Repeated, is_first)
}
