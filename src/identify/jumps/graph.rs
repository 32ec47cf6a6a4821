//! Neighbours of scattered points, and the unwrapping of a phase over them.

use std::sync::OnceLock;

use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::field::bounds;
use crate::numeric::Forest;

/// A region has at least this many points; fewer are outliers, which keep the orders around them. (Of a square of 25 points
/// the outlier rule takes the four corners.)
pub const FEWEST: usize = 20;

/// Neighbours of a point: on a grid those beside it and at its corners.
const NEIGHBOURS: usize = 8;

/// The nearest other points of each point.
pub(super) struct Graph {
    near: Vec<u32>,
    each: usize,
}

impl Graph {
    pub(super) fn new(points: &[[f64; 2]]) -> Self {
        let each = NEIGHBOURS.min(points.len().saturating_sub(1));
        let mut near = vec![0; each * points.len()];
        if each > 0 {
            let cells = Buckets::new(points);
            let tree = OnceLock::new();
            near.par_chunks_mut(each)
                .enumerate()
                .for_each(|(i, slots)| {
                    if !cells.nearest(points, i, slots) {
                        let tree = tree.get_or_init(|| indexed(points));
                        let others = tree
                            .nearest_neighbor_iter(points[i])
                            .map(|entry| entry.data)
                            .filter(|&j| j as usize != i);
                        for (slot, j) in slots.iter_mut().zip(others) {
                            *slot = j;
                        }
                    }
                });
        }
        Self { near, each }
    }

    /// The neighbours of point `i`, nearest first. Not every neighbour has `i` among its own.
    pub(super) fn neighbours(&self, i: usize) -> &[u32] {
        &self.near[i * self.each..(i + 1) * self.each]
    }

    /// Phase of `values` (cycles), within half a cycle of zero, averaged over each point and its neighbours as unit
    /// vectors: whole cycles do not show in it, and an outlier counts no more than any other point.
    pub(super) fn smoothed_phase(&self, values: &[f64]) -> Vec<f64> {
        let vectors: Vec<(f64, f64)> = values
            .iter()
            .map(|v| (std::f64::consts::TAU * (v - v.round())).sin_cos())
            .collect();
        (0..values.len())
            .map(|i| {
                let (sin, cos) = self.neighbours(i).iter().fold(vectors[i], |sum, &j| {
                    let v = vectors[j as usize];
                    (sum.0 + v.0, sum.1 + v.1)
                });
                sin.atan2(cos) / std::f64::consts::TAU
            })
            .collect()
    }

    /// A phase (cycles) made continuous by whole cycles, along the smallest steps first; and the connected part of
    /// the field of each point, as one of its points.
    pub(super) fn unwrap(&self, phase: &[f64]) -> (Vec<f64>, Vec<u32>) {
        const BINS: usize = 64;
        let wrapped = |i: usize, j: usize| {
            let step = phase[j] - phase[i];
            (step - step.round()).abs()
        };
        let bin = |i: usize, j: usize| ((2.0 * BINS as f64 * wrapped(i, j)) as usize).min(BINS - 1);
        // counting sort of the steps; a pair that is mutual comes once
        let pairs = || {
            (0..phase.len()).flat_map(|i| {
                self.neighbours(i)
                    .iter()
                    .map(move |&j| (i, j as usize))
                    .filter(|&(i, j)| i < j || !self.neighbours(j).contains(&(i as u32)))
            })
        };
        let mut sorted: Vec<Vec<(u32, u32)>> = vec![Vec::new(); BINS];
        for (i, j) in pairs() {
            sorted[bin(i, j)].push((i as u32, j as u32));
        }
        let mut offsets = Forest::new(phase.len());
        for (i, j) in sorted.into_iter().flatten() {
            let turns = -(phase[j as usize] - phase[i as usize]).round() as i32;
            offsets.join(i, j, turns);
        }
        (0..phase.len())
            .map(|i| {
                let (root, turns) = offsets.root(i as u32);
                (phase[i] + f64::from(turns), root)
            })
            .unzip()
    }
}

fn indexed(points: &[[f64; 2]]) -> RTree<GeomWithData<[f64; 2], u32>> {
    let entries = points
        .iter()
        .enumerate()
        .map(|(i, &p)| GeomWithData::new(p, i as u32));
    RTree::bulk_load(entries.collect())
}

/// Points sorted into square cells that hold about five: ten times as fast as a tree where the points are even.
struct Buckets {
    low: [f64; 2],
    side: f64,
    count: [usize; 2],
    start: Vec<u32>,
    members: Vec<u32>,
}

impl Buckets {
    fn new(points: &[[f64; 2]]) -> Self {
        let [low, high] = bounds(points);
        let extent = [0, 1].map(|k| high[k] - low[k]);
        let n = points.len() as f64;
        // points on a line have no area
        let side = (2.3 * (extent[0] * extent[1] / n).sqrt())
            .max(extent[0].max(extent[1]) / n)
            .max(f64::MIN_POSITIVE);
        let count = extent.map(|e| (e / side) as usize + 1);
        let mut cells = Self {
            low,
            side,
            count,
            start: vec![0; count[0] * count[1] + 1],
            members: vec![0; points.len()],
        };
        let place = |[a, b]: [usize; 2]| a * count[1] + b;
        let of_point: Vec<usize> = points.iter().map(|p| place(cells.cell(*p))).collect();
        of_point.iter().for_each(|&c| cells.start[c + 1] += 1);
        for c in 0..count[0] * count[1] {
            cells.start[c + 1] += cells.start[c];
        }
        let mut next = cells.start.clone();
        for (i, &c) in of_point.iter().enumerate() {
            cells.members[next[c] as usize] = i as u32;
            next[c] += 1;
        }
        cells
    }

    fn cell(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| (((p[k] - self.low[k]) / self.side) as usize).min(self.count[k] - 1))
    }

    /// Fill `slots` with the nearest others of point `i`, nearest first; false where they may lie beyond the cells
    /// around its own.
    fn nearest(&self, points: &[[f64; 2]], i: usize, slots: &mut [u32]) -> bool {
        let p = points[i];
        let [a, b] = self.cell(p);
        let mut found: Vec<(f64, u32)> = Vec::with_capacity(64);
        for row in a.saturating_sub(1)..=(a + 1).min(self.count[0] - 1) {
            let first = row * self.count[1] + b.saturating_sub(1);
            let last = row * self.count[1] + (b + 1).min(self.count[1] - 1);
            for &j in &self.members[self.start[first] as usize..self.start[last + 1] as usize] {
                let q = points[j as usize];
                if j as usize != i {
                    found.push(((q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2), j));
                }
            }
        }
        found.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for (slot, (_, j)) in slots.iter_mut().zip(&found) {
            *slot = *j;
        }
        found
            .get(slots.len() - 1)
            .is_some_and(|(d2, _)| *d2 <= self.side * self.side)
    }
}
