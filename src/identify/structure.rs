//! Whether a residual has structure beyond the noise: spatial autocorrelation, variogram, where it lies.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

use crate::field::Blocks;
use crate::noise::Noise;
use crate::quantity::NM_PER_MM;

/// Structure of a residual's block averages.
#[derive(Debug, Clone)]
pub struct Structure {
    /// Moran's I of each component over adjacent blocks.
    pub moran: [f64; 2],
    /// Probability of a Moran's I as large, of either component, from the estimated noise alone, by permutation of the
    /// whitened residual.
    pub p_spatial: f64,
    pub variogram: Vec<VariogramLag>,
    /// Rings about the hole, from the inside.
    pub rings: Vec<RingRms>,
    /// RMS of the quadrants (+s +t, -s +t, -s -t, +s -t) of each component's block averages, nm.
    pub quadrants: [[f64; 2]; 4],
}

/// One distance of a variogram, with the semivariance of each component.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VariogramLag {
    pub distance_mm: f64,
    pub u1_nm2: f64,
    pub u2_nm2: f64,
}

/// RMS of the block averages in one ring.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RingRms {
    pub to_radius_mm: f64,
    pub u1_nm: f64,
    pub u2_nm: f64,
}

/// Permutations behind a p-value.
const PERMUTATIONS: usize = 999;

/// Rings about the hole.
const RINGS: usize = 6;

/// Distances of a variogram.
const LAGS: usize = 12;

impl Structure {
    /// Of a residual (mm) at the measured points.
    pub fn of(residual: &[[f64; 2]], noise: &Noise, seed: u64) -> Self {
        let blocks = &noise.blocks;
        let average = |c: usize| {
            let values: Vec<f64> = residual.iter().map(|r| r[c]).collect();
            blocks.average(&values)
        };
        let r = [average(0), average(1)];
        let neighbours = neighbours(blocks);
        let mut exceeded = 0;
        let moran = [0, 1].map(|c| morans_i(&r[c], &neighbours));
        let mut rng = Pcg64Dxsm::seed_from_u64(seed);
        let null = [0, 1].map(|c| permuted(&r[c], noise, c, &neighbours, &mut rng));
        // the larger of both components' ranks, against the same of each permutation
        let rank = |c: usize, value: f64| null[c].iter().filter(|i| **i >= value).count();
        let observed = rank(0, moran[0]).min(rank(1, moran[1]));
        for (&first, &second) in null[0].iter().zip(&null[1]) {
            let this = rank(0, first).min(rank(1, second));
            exceeded += usize::from(this <= observed + 1);
        }
        Self {
            moran,
            p_spatial: (exceeded + 1) as f64 / (PERMUTATIONS + 1) as f64,
            variogram: variogram(blocks, &r),
            rings: rings(blocks, &r),
            quadrants: quadrants(blocks, &r),
        }
    }
}

/// Pairs of blocks that share an edge.
fn neighbours(blocks: &Blocks) -> Vec<[usize; 2]> {
    let reach = 1.3 * blocks.size_mm;
    let mut pairs = Vec::new();
    for i in 0..blocks.len() {
        for j in i + 1..blocks.len() {
            let (a, b) = (blocks.centroid[i], blocks.centroid[j]);
            if (a[0] - b[0]).hypot(a[1] - b[1]) < reach {
                pairs.push([i, j]);
            }
        }
    }
    pairs
}

/// Moran's I with weight 1 for adjacent blocks.
fn morans_i(r: &DVector<f64>, neighbours: &[[usize; 2]]) -> f64 {
    let mean = r.mean();
    let square: f64 = r.iter().map(|v| (v - mean).powi(2)).sum();
    let sum: f64 = neighbours
        .iter()
        .map(|&[i, j]| (r[i] - mean) * (r[j] - mean))
        .sum();
    let n = r.len() as f64 / neighbours.len().max(1) as f64;
    if square > 0.0 { n * sum / square } else { 0.0 }
}

/// Moran's I of permuted residuals: whitened by the noise's covariance, shuffled, coloured again.
fn permuted(
    r: &DVector<f64>,
    noise: &Noise,
    c: usize,
    neighbours: &[[usize; 2]],
    rng: &mut Pcg64Dxsm,
) -> Vec<f64> {
    let column = DMatrix::from_column_slice(r.len(), 1, r.as_slice());
    let mut white: Vec<f64> = noise.whiten(&column, c).as_slice().to_vec();
    let shuffled: Vec<DVector<f64>> = (0..PERMUTATIONS)
        .map(|_| {
            white.shuffle(rng);
            DVector::from_column_slice(&white)
        })
        .collect();
    let coloured = noise.colour(&DMatrix::from_columns(&shuffled), c);
    coloured
        .column_iter()
        .map(|r| morans_i(&r.into_owned(), neighbours))
        .collect()
}

fn variogram(blocks: &Blocks, r: &[DVector<f64>; 2]) -> Vec<VariogramLag> {
    let mut bins = vec![([0.0; 2], 0_usize); LAGS];
    for i in 0..blocks.len() {
        for j in i + 1..blocks.len() {
            let (a, b) = (blocks.centroid[i], blocks.centroid[j]);
            let lag = ((a[0] - b[0]).hypot(a[1] - b[1]) / blocks.size_mm).round() as usize;
            if (1..=LAGS).contains(&lag) {
                let (sum, count) = &mut bins[lag - 1];
                *count += 1;
                for c in 0..2 {
                    sum[c] += 0.5 * (r[c][i] - r[c][j]).powi(2);
                }
            }
        }
    }
    bins.iter()
        .enumerate()
        .filter(|(_, (_, count))| *count > 0)
        .map(|(k, (sum, count))| {
            let nm2 = NM_PER_MM * NM_PER_MM / *count as f64;
            let [u1_nm2, u2_nm2] = sum.map(|s| s * nm2);
            VariogramLag {
                distance_mm: (k + 1) as f64 * blocks.size_mm,
                u1_nm2,
                u2_nm2,
            }
        })
        .collect()
}

fn rms(r: &[DVector<f64>; 2], members: &[usize]) -> [f64; 2] {
    let n = members.len().max(1) as f64;
    [0, 1].map(|c| (members.iter().map(|&b| r[c][b].powi(2)).sum::<f64>() / n).sqrt() * NM_PER_MM)
}

fn rings(blocks: &Blocks, r: &[DVector<f64>; 2]) -> Vec<RingRms> {
    let radius = |b: usize| blocks.centroid[b][0].hypot(blocks.centroid[b][1]);
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by(|&a, &b| radius(a).total_cmp(&radius(b)));
    order
        .chunks(blocks.len().div_ceil(RINGS).max(1))
        .map(|members| {
            let [u1_nm, u2_nm] = rms(r, members);
            RingRms {
                to_radius_mm: members.last().map_or(0.0, |&b| radius(b)),
                u1_nm,
                u2_nm,
            }
        })
        .collect()
}

fn quadrants(blocks: &Blocks, r: &[DVector<f64>; 2]) -> [[f64; 2]; 4] {
    [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|sign| {
        let members: Vec<usize> = (0..blocks.len())
            .filter(|&b| (0..2).all(|k| sign[k] * blocks.centroid[b][k] >= 0.0))
            .collect();
        rms(r, &members)
    })
}
