//! Leave-one-out error of a truncated POD (Gogu et al. 2013, Table 8).

use faer::linalg::matmul::matmul;
use faer::{Accum, ColRef, Mat, Par};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use plychain::reduce::Pod;

/// CV_RMS of one displacement component for K = 1, 2, ... modes.
#[derive(Debug)]
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
            let mut rests = vec![c];
            for &k in order.iter().take(most) {
                let axis = eigen.eigenvectors.column(k);
                let rest = &rests[rests.len() - 1];
                rests.push(rest - axis * axis.dot(rest));
            }
            let fields = fields(&pod.modes, &rests);
            let errors = (1..rests.len()).map(|k| largest(fields.col(k), fields.col(0)));
            errors.collect()
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

/// The fields with the given coordinates in the leading modes, one a column.
fn fields(modes: &Mat<f64>, coordinates: &[DVector<f64>]) -> Mat<f64> {
    let rank = coordinates[0].len();
    let coordinates = Mat::from_fn(rank, coordinates.len(), |r, k| coordinates[k][r]);
    let mut fields = Mat::zeros(modes.nrows(), coordinates.ncols());
    let leading = modes.subcols(0, rank);
    let out = fields.as_mut();
    matmul(out, Accum::Replace, leading, &coordinates, 1.0, Par::Seq);
    fields
}

/// The largest absolute error and the field there.
fn largest(error: ColRef<'_, f64>, field: ColRef<'_, f64>) -> [f64; 2] {
    let both = error.iter().zip(field.iter());
    both.fold([0.0; 2], |most, (e, f)| {
        if e.abs() > most[0] {
            [e.abs(), *f]
        } else {
            most
        }
    })
}
