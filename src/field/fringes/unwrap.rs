//! Unwrapping by reliability (Herraez, Burton, Lalor and Gdeisat, Applied Optics 41 (2002) 7437): pixels are joined in the order of how sure
//! the step between them is, so that doubtful ones come last. A step is sure where it is near the density of fringes around it and where the
//! noise is small; steps are counted from that density, so that fringes of almost half an order a pixel are followed all the same.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::phase::{FringeDensity, PhaseMap, Pixel};
use crate::numeric::Forest;

/// Connected parts with fewer pixels, or a smaller share of the picture, are left out: their orders are nobody's.
const FEWEST: usize = 25;
const LEAST_SHARE: f64 = 5e-4;

/// Unwrap in place. Returns the sizes of the connected parts, largest first: whole orders between them are not known.
pub fn unwrap(phase: &mut PhaseMap) -> Vec<usize> {
    let density = phase.density();
    let mut forest = Forest::new(phase.pixel.len());
    for edge in edges(phase, &density) {
        let edge = (edge & u64::from(u32::MAX)) as usize;
        let (first, next) = (
            edge / 2,
            if edge.is_multiple_of(2) {
                1
            } else {
                phase.cols
            },
        );
        let second = first + next;
        let raw = phase.difference[second] - phase.difference[first];
        let expected = f64::from(density[edge % 2][first]);
        let step = -((raw - expected) / TAU).round() as i32;
        forest.join(first as u32, second as u32, step);
    }
    let pixels = 0..phase.pixel.len() as u32;
    let found: Vec<(u32, i32)> = pixels.map(|i| forest.root(i)).collect();
    settle(phase, &found, &forest)
}

/// Steps between measured neighbours, the surest first: 2 i for the one along a row, 2 i + 1 along a column. Pictures have less than 2^31
/// pixels, so that doubt and step fit into one word, which sorts faster.
fn edges(phase: &PhaseMap, density: &FringeDensity) -> Vec<u64> {
    use rayon::prelude::*;
    let cols = phase.cols;
    let mut edges: Vec<u64> = (0..2 * phase.pixel.len())
        .into_par_iter()
        .filter_map(|edge| {
            let first = edge / 2;
            let second = first + if edge % 2 == 0 { 1 } else { cols };
            let inside = second < phase.pixel.len() && (edge % 2 == 1 || second % cols > 0);
            if !(inside && phase.is_measured(first) && phase.is_measured(second)) {
                return None;
            }
            let raw = phase.difference[second] - phase.difference[first];
            let beyond = raw - f64::from(density[edge % 2][first]);
            let beyond = beyond - TAU * (beyond / TAU).round();
            let variance = phase.sd[first].powi(2) + phase.sd[second].powi(2);
            let doubt = beyond * beyond + variance;
            Some(((doubt * 1e6) as u64) << 32 | edge as u64)
        })
        .collect();
    edges.par_sort_unstable();
    edges
}

/// Add the orders; leave out small parts; bring the largest one's mean within half an order of zero, and the others' of that.
fn settle(phase: &mut PhaseMap, found: &[(u32, i32)], forest: &Forest) -> Vec<usize> {
    let mut sums: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
    let share = (LEAST_SHARE * phase.pixel.len() as f64) as usize;
    let fewest = FEWEST.max(share);
    for (i, &(root, orders)) in found.iter().enumerate() {
        if !phase.is_measured(i) {
            continue;
        }
        if forest.size(root) < fewest {
            phase.pixel[i] = Pixel::Isolated;
            continue;
        }
        phase.difference[i] += TAU * f64::from(orders);
        let sum = sums.entry(root).or_default();
        sum.0 += phase.difference[i];
        sum.1 += 1;
    }
    let Some((_, largest)) = sums.iter().max_by_key(|(_, (_, n))| *n) else {
        return Vec::new();
    };
    let of = |(sum, n): &(f64, usize)| sum / *n as f64;
    let whole = |phase: f64| TAU * (phase / TAU).round();
    let about = of(largest) - whole(of(largest));
    for (i, &(root, _)) in found.iter().enumerate() {
        if phase.is_measured(i) {
            phase.difference[i] -= whole(of(&sums[&root]) - about);
        }
    }
    let mut sizes: Vec<usize> = sums.values().map(|(_, n)| *n).collect();
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}
