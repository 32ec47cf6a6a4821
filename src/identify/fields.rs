//! The fields that a specimen can have at the measured points, whatever its constants are: what a measurement is looked at with before its
//! noise is known.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::error::Result;
use crate::experiment::{FieldSolver, PointSet, State, predict};
use crate::noise::reml::orthonormal;

/// Fields of which the span is taken, spread over the box of the constants.
const FIELDS: usize = 12;

/// Columns that span what the constants make of a sight's points, orthonormal over them and without a unit: those of u1, then as many of u2.
/// `[k][i]` is (u1, u2) of column k at point i; of the columns of u1, u2 is 0.
///
/// # Errors
/// Those of a finite-element solution.
pub fn modes(
    experiment: &dyn FieldSolver,
    states: &[State],
    sight: &PointSet,
) -> Result<Vec<Vec<[f64; 2]>>> {
    let every = states.len().div_ceil(FIELDS).max(1);
    let some: Vec<&State> = states.iter().step_by(every).collect();
    let fields: Vec<Result<Vec<[f64; 2]>>> = some
        .par_iter()
        .map(|state| Ok(predict(experiment, state, sight)?.field))
        .collect();
    let fields = fields.into_iter().collect::<Result<Vec<_>>>()?;
    let count = sight.points().len();
    let bases = [0, 1].map(|c| {
        orthonormal(&DMatrix::from_fn(count, fields.len(), |i, k| {
            fields[k][i][c]
        }))
    });
    let rank = bases.iter().map(DMatrix::ncols).min().unwrap_or(0);
    let column = |c: usize, k: usize| -> Vec<[f64; 2]> {
        let own = bases[c].column(k);
        let value = |v: &f64| if c == 0 { [*v, 0.0] } else { [0.0, *v] };
        own.iter().map(value).collect()
    };
    let both = (0..2).flat_map(|c| (0..rank).map(move |k| (c, k)));
    Ok(both.map(|(c, k)| column(c, k)).collect())
}
