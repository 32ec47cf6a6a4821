//! Deviant points: points whose residual from a fitted model contradicts the residuals around them. They are what is left of
//! bad points at edges and in clusters, where the field itself is too steep to tell ([`super::outliers`]).

use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::local::mad;
use crate::numeric::median;

/// Neighbours that a residual is compared with.
const NEIGHBOURS: usize = 24;
/// A deviation beyond this many standard deviations (by the MAD of all deviations) makes a deviant point.
const MULTIPLE: f64 = 8.0;
/// This share of the neighbours with a like deviation make it a feature of the field.
const COMPANIONS: f64 = 0.25;

/// Which points are deviant, of residuals (u1, u2) at `points`: those that differ from the median of their neighbours by
/// far more than residuals usually do, unless a quarter of the neighbours differ likewise.
pub fn deviant_points(points: &[[f64; 2]], residual: &[[f64; 2]]) -> Vec<bool> {
    let tree = RTree::bulk_load(
        points
            .iter()
            .enumerate()
            .map(|(i, &p)| GeomWithData::new(p, i))
            .collect(),
    );
    let neighbours: Vec<Vec<usize>> = points
        .par_iter()
        .enumerate()
        .map(|(i, &p)| {
            tree.nearest_neighbor_iter(p)
                .map(|n| n.data)
                .filter(|&j| j != i)
                .take(NEIGHBOURS)
                .collect()
        })
        .collect();
    let mut deviant = vec![false; points.len()];
    for c in 0..2 {
        let middle: Vec<f64> = neighbours
            .par_iter()
            .map(|near| median(&mut near.iter().map(|&j| residual[j][c]).collect::<Vec<_>>()))
            .collect();
        let deviation: Vec<f64> = residual
            .iter()
            .zip(&middle)
            .map(|(r, m)| r[c] - m)
            .collect();
        let bound = MULTIPLE * mad(deviation.iter().copied());
        for (i, d) in deviation
            .iter()
            .enumerate()
            .filter(|(_, d)| d.abs() > bound)
        {
            let alike = neighbours[i]
                .iter()
                .filter(|&&j| (residual[j][c] - middle[i]) * d.signum() > 0.5 * d.abs())
                .count();
            deviant[i] |= (alike as f64) < COMPANIONS * neighbours[i].len() as f64;
        }
    }
    deviant
}
