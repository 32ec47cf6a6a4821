//! Noise of the pictures of a series.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;

use crate::experiment::Subsets;
use crate::field::Grid;
use crate::noise::matern_pair;

/// Pictures of which every one has the same noise.
pub struct Pictures<'a> {
    /// Points, on a square lattice.
    pub grid: &'a Grid,
    /// Subsets over which white noise is averaged.
    pub subsets: Option<Subsets>,
    /// Correlation length of Matern-3/2 noise in place of white, mm; 0 for none.
    pub correlation_mm: f64,
    /// Sd at a point, mm.
    pub sd_mm: f64,
}

/// Cells to the side of a subset, at least, on which noise is white.
const CELLS: f64 = 8.0;

impl Pictures<'_> {
    /// What one picture adds at all points of the grid, mm. That of a cut subset is taken to be that of a whole one.
    pub fn noise(&self, seed: u64) -> Vec<[f64; 2]> {
        let Self {
            grid,
            correlation_mm,
            sd_mm,
            ..
        } = *self;
        if sd_mm == 0.0 {
            return vec![[0.0; 2]; grid.points.len()];
        }
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let spacing = grid.points[1][0] - grid.points[0][0];
        let shape = [grid.rows, grid.cols];
        let [a, b] = if correlation_mm > 0.0 {
            matern_pair(shape, [spacing; 2], correlation_mm, &mut rng)
        } else {
            // subsets that do not overlap have nothing in common
            let averaged = self.subsets.filter(|s| s.side_mm > spacing);
            [(); 2].map(|()| match averaged {
                Some(subsets) => through(&subsets, spacing, shape, &mut rng),
                None => white(shape[0] * shape[1], &mut rng),
            })
        };
        a.iter()
            .zip(&b)
            .map(|(a, b)| [sd_mm * a, sd_mm * b])
            .collect()
    }
}

fn white(count: usize, rng: &mut Pcg64Dxsm) -> Vec<f64> {
    (0..count).map(|_| StandardNormal.sample(rng)).collect()
}

/// White noise of small cells as subsets about the points of a square lattice report it, of unit sd, row by row.
fn through(
    subsets: &Subsets,
    spacing: f64,
    [rows, cols]: [usize; 2],
    rng: &mut Pcg64Dxsm,
) -> Vec<f64> {
    let [pitch, side] = cells(subsets.side_mm / spacing);
    let weights = subsets.of_cells(side);
    let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
    let width = pitch * (cols - 1) + side;
    let all = white((pitch * (rows - 1) + side) * width, rng);
    let at = |k: usize| {
        let corner = pitch * (k / cols) * width + pitch * (k % cols);
        let row = |(i, weights): (usize, &[f64])| -> f64 {
            let cells = &all[corner + i * width..][..side];
            cells.iter().zip(weights).map(|(z, w)| z * w).sum()
        };
        weights.chunks(side).enumerate().map(row).sum::<f64>() / norm
    };
    (0..rows * cols).into_par_iter().map(at).collect()
}

/// Cells to the spacing of points, and to the side of a subset of `share` spacings, of which a whole number comes nearest to it.
fn cells(share: f64) -> [usize; 2] {
    let least = (CELLS / share).ceil().max(1.0) as usize;
    let side = |pitch: usize| share * pitch as f64;
    let off = |pitch: &usize| (side(*pitch).round() / side(*pitch) - 1.0).abs();
    let best = (least..=2 * least).min_by(|a, b| off(a).total_cmp(&off(b)));
    let pitch = best.unwrap_or(least);
    [pitch, side(pitch).round() as usize]
}
