//! What a patch does to the blocks about it: a bump, a strain, or a surface that does not follow.
//!
//! With g = exp(-d^2 / 2 a^2) about a place x0: a bump is g e_i, a strain g (x - x0)_j e_i, and what does not follow -g [u(x) - u(x0)] of the
//! displacement u that the model expects. Its amplitude is the share of the strain that is lost: 1 of paint that has come off.

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::field::{Blocks, bounds};

/// Radii a, mm, of patches that are sought.
const RADII_MM: [f64; 4] = [1.0, 1.7, 3.0, 5.0];

/// Distance of neighbouring places over the radius, and at least, mm.
const APART: f64 = 0.75;

/// A patch ends so many radii from its place.
const REACH: f64 = 3.5;

/// Share of a patch that must lie on measured points.
const LEAST_SEEN: f64 = 0.35;

/// What a patch is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchFamily {
    /// The points are displaced.
    Bump,
    /// The points are strained or turned.
    Strain,
    /// The points lose a share of the strain beneath them.
    NotFollowing,
}

impl PatchFamily {
    pub(super) const ALL: [Self; 3] = [Self::Bump, Self::Strain, Self::NotFollowing];

    /// Which column of a place's values each amplitude uses in u1 and in u2.
    pub(super) fn amplitudes(self) -> &'static [[Option<usize>; 2]] {
        match self {
            Self::Bump => &[[Some(0), None], [None, Some(0)]],
            Self::Strain => &[
                [Some(1), None],
                [Some(2), None],
                [None, Some(1)],
                [None, Some(2)],
            ],
            Self::NotFollowing => &[[Some(3), Some(4)]],
        }
    }
}

/// Columns of a place's values.
pub(super) const VALUES: usize = 5;

/// A patch at a place: what each family does to the blocks that it reaches.
pub struct PatchPlace {
    /// Its middle (s, t) and its radius, mm.
    pub at: [f64; 2],
    pub radius_mm: f64,
    /// The blocks that it reaches.
    pub(super) blocks: Vec<usize>,
    /// Averages over them of g, g (s - s0), g (t - t0), and of what does not follow of u1 and of u2: blocks x 5.
    pub(super) values: DMatrix<f64>,
}

/// The measured points that patches lie on.
#[derive(Clone, Copy)]
pub struct PatchedPoints<'a> {
    pub blocks: &'a Blocks,
    pub points: &'a [[f64; 2]],
    /// What the model expects of every point under the largest force, mm; empty where nothing can fail to follow.
    pub displacement: &'a [[f64; 2]],
}

impl PatchedPoints<'_> {
    /// All patches that enough points see.
    pub fn places(&self) -> Vec<PatchPlace> {
        let used: Vec<usize> = (0..self.points.len())
            .filter(|&i| self.blocks.of_point[i].is_some())
            .collect();
        let middles = RADII_MM.iter().flat_map(|&a| {
            let apart = (APART * a).max(APART);
            let lattice = self.lattice(apart);
            lattice.into_iter().map(move |at| (at, a))
        });
        let middles: Vec<([f64; 2], f64)> = middles.collect();
        let found = middles.par_iter().map(|&(at, a)| self.place(at, a, &used));
        let found: Vec<Option<PatchPlace>> = found.collect();
        found.into_iter().flatten().collect()
    }

    /// Places all over the window.
    fn lattice(&self, apart: f64) -> Vec<[f64; 2]> {
        let [low, high] = bounds(&self.blocks.centroid);
        let count = [0, 1].map(|k| ((high[k] - low[k]) / apart).floor() as usize + 1);
        let begin =
            [0, 1].map(|k| 0.5 * (low[k] + high[k]) - 0.5 * apart * (count[k] as f64 - 1.0));
        let row = |i: usize| {
            (0..count[1]).map(move |j| [begin[0] + apart * i as f64, begin[1] + apart * j as f64])
        };
        (0..count[0]).flat_map(row).collect()
    }

    /// Area that one point stands for, mm^2: that of a block over the points of a typical one.
    fn area(&self) -> f64 {
        let mut counts = self.blocks.count.clone();
        counts.sort_unstable();
        let typical = counts.get(counts.len() * 3 / 4).copied().unwrap_or(1);
        self.blocks.size_mm.powi(2) / typical.max(1) as f64
    }

    fn place(&self, at: [f64; 2], a: f64, used: &[usize]) -> Option<PatchPlace> {
        let offset = |i: usize| [0, 1].map(|k| self.points[i][k] - at[k]);
        let square = |i: usize| offset(i).map(|d| d * d).iter().sum::<f64>();
        let near: Vec<usize> = used
            .iter()
            .copied()
            .filter(|&i| square(i) < (REACH * a).powi(2))
            .collect();
        let bell = |i: usize| (-0.5 * square(i) / (a * a)).exp();
        let seen: f64 = near.iter().map(|&i| bell(i)).sum();
        if seen * self.area() < LEAST_SEEN * std::f64::consts::TAU * a * a {
            return None;
        }
        let nearest = near
            .iter()
            .copied()
            .min_by(|&i, &j| square(i).total_cmp(&square(j)))?;
        let mut blocks: Vec<usize> = near
            .iter()
            .filter_map(|&i| self.blocks.of_point[i])
            .map(|b| b as usize)
            .collect();
        blocks.sort_unstable();
        blocks.dedup();
        let mut values = DMatrix::zeros(blocks.len(), VALUES);
        for &i in &near {
            let block = self.blocks.of_point[i].map(|b| b as usize);
            let Some(row) = block.and_then(|b| blocks.binary_search(&b).ok()) else {
                continue;
            };
            let weight = self.blocks.weight.as_ref().map_or(1.0, |w| w[i]);
            let g = weight * bell(i) / self.blocks.worth[blocks[row]];
            let [s, t] = offset(i);
            let lost = match self.displacement {
                [] => [0.0; 2],
                u => [0, 1].map(|c| u[nearest][c] - u[i][c]),
            };
            let all = [1.0, s, t, lost[0], lost[1]];
            for (k, value) in all.into_iter().enumerate() {
                values[(row, k)] += g * value;
            }
        }
        Some(PatchPlace {
            at,
            radius_mm: a,
            blocks,
            values,
        })
    }
}
