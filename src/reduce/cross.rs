//! Leave-one-out error of a truncated POD (Gogu et al. 2013, Table 8).

use faer::Mat;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::pod::Pod;

/// CV_RMS of one displacement component for K = 1, 2, ... modes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CrossValidation {
    /// Root mean square, over the snapshots left out, of the largest absolute field error, mm.
    pub mm: Vec<f64>,
    /// The same relative to the root mean square of the field where that error occurs, %.
    pub percent: Vec<f64>,
}

/// Coordinates in the POD of all snapshots that carry a snapshot left out: what lies beyond them is rounding.
const RANK: usize = 24;

/// Each snapshot against the POD of the others, for K = 1..=`most`. The other snapshots lie in the span of all, so that
/// their POD is an eigenproblem in the leading coordinates, not another SVD of fields.
pub fn leave_one_out(pod: &Pod, most: usize) -> CrossValidation {
    let rank = RANK.min(pod.singular.len());
    let count = pod.right.nrows();
    let coordinates = DMatrix::from_fn(rank, count, |r, i| pod.singular[r] * pod.right[(i, r)]);
    let full = &coordinates * coordinates.transpose();
    let errors: Vec<Vec<[f64; 2]>> = (0..count)
        .into_par_iter()
        .map(|left_out| {
            let c = coordinates.column(left_out).clone_owned();
            let eigen = SymmetricEigen::new(&full - &c * c.transpose());
            let mut order: Vec<usize> = (0..rank).collect();
            order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
            let field = field(&pod.modes, &c);
            let mut rest = c;
            (0..most.min(rank))
                .map(|k| {
                    let axis = eigen.eigenvectors.column(order[k]);
                    rest -= axis * axis.dot(&rest);
                    largest(&self::field(&pod.modes, &rest), &field)
                })
                .collect()
        })
        .collect();
    let rms = |k: usize, part: usize| {
        let sum: f64 = errors.iter().map(|e| e[k][part] * e[k][part]).sum();
        (sum / count as f64).sqrt()
    };
    let kept = most.min(rank);
    CrossValidation {
        mm: (0..kept).map(|k| rms(k, 0)).collect(),
        percent: (0..kept).map(|k| 100.0 * rms(k, 0) / rms(k, 1)).collect(),
    }
}

/// The field with the given coordinates in the leading modes.
fn field(modes: &Mat<f64>, coordinates: &DVector<f64>) -> Vec<f64> {
    let mut field = vec![0.0; modes.nrows()];
    for (r, &c) in coordinates.iter().enumerate() {
        for (f, m) in field.iter_mut().zip(modes.col(r).iter()) {
            *f += c * m;
        }
    }
    field
}

/// The largest absolute error and the field there.
fn largest(error: &[f64], field: &[f64]) -> [f64; 2] {
    error.iter().zip(field).fold([0.0; 2], |most, (e, f)| {
        if e.abs() > most[0] {
            [e.abs(), *f]
        } else {
            most
        }
    })
}
