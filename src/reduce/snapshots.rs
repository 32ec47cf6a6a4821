//! An experiment's prediction over the design, as fields on its support.

use faer::Mat;
use rayon::prelude::*;

use super::design::{Dimension, latin_hypercube};
use super::problem::Problem;
use crate::effect::{Acting, Kind};
use crate::error::{Error, Result};
use crate::experiment::{State, predict};
use crate::numeric::add_scaled;

/// Snapshots of both displacement components.
pub struct Snapshots {
    /// DoE points, border units, one row of `dimensions.len()` values a snapshot.
    pub points: Vec<Vec<f64>>,
    /// u1 and u2 in mm at the experiment's support, each points x snapshots, gauged over it.
    pub fields: [Mat<f64>; 2],
}

/// Design seed: the reduced model does not depend on the seed of the chains.
const DESIGN_SEED: u64 = 2013;

/// Memory of the snapshot matrices of both components, at most, bytes; their decomposition takes about three times it.
const LARGEST: usize = 512 << 20;

fn check_memory(nodes: usize, snapshots: usize) -> Result<()> {
    let each = 2 * nodes * size_of::<f64>();
    if each * snapshots <= LARGEST {
        return Ok(());
    }
    Err(Error::input(
        "reduced_model.snapshots",
        format!("at most {} for a support of {nodes} points", LARGEST / each),
    )
    .found(snapshots)
    .hint("more than some hundred gain nothing: the response surfaces are cubic"))
}

impl Snapshots {
    /// Predict over a Latin hypercube of `problem.spec.snapshots` points. `step` is called after each prediction.
    pub fn compute(problem: &Problem, step: &(dyn Fn() + Sync)) -> Result<Self> {
        Self::at(problem, design(problem), step)
    }

    /// Predict at given points of the design. `step` is called after each prediction.
    ///
    /// # Errors
    /// Those of a prediction; more snapshots than memory holds.
    pub fn at(problem: &Problem, points: Vec<Vec<f64>>, step: &(dyn Fn() + Sync)) -> Result<Self> {
        let experiment = &*problem.experiment;
        let support = experiment.support();
        let count = support.points().len();
        check_memory(count, points.len())?;
        let states: Vec<State> = points.iter().map(|p| problem.state(p)).collect();
        let spanning = experiment.spanning(support);
        let solutions: Vec<Vec<[f64; 2]>> = states
            .par_iter()
            .map(|state| {
                let known = experiment.coordinates(state);
                let field = match known.filter(|_| state.acting().iter().all(is_in_the_plate)) {
                    Some(answer) => sum(&spanning, answer.coordinates.as_slice(), count),
                    None => predict(experiment, state, support)?.field,
                };
                step();
                Ok(field)
            })
            .collect::<Result<_>>()?;
        let fields = [0, 1].map(|c| Mat::from_fn(count, points.len(), |i, j| solutions[j][i][c]));
        Ok(Self { points, fields })
    }
}

/// Whether an effect changes the specimen or its load, and adds nothing to what that shows.
fn is_in_the_plate(acting: &Acting) -> bool {
    acting.effect.kind() == Kind::Mechanical
}

/// A sum of fields.
fn sum(fields: &[Vec<[f64; 2]>], factors: &[f64], count: usize) -> Vec<[f64; 2]> {
    let mut sum = vec![[0.0; 2]; count];
    for (field, factor) in fields.iter().zip(factors) {
        add_scaled(&mut sum, field, *factor);
    }
    sum
}

/// The points of a problem's design, one row a snapshot.
pub fn design(problem: &Problem) -> Vec<Vec<f64>> {
    spread_over(problem, problem.spec.snapshots, DESIGN_SEED)
}

/// A Latin hypercube of so many points over a problem's box.
pub fn spread_over(problem: &Problem, count: usize, seed: u64) -> Vec<Vec<f64>> {
    latin_hypercube(count, problem.dimensions.len(), seed)
        .iter()
        .map(|unit| scale(&problem.dimensions, unit))
        .collect()
}

fn scale(dimensions: &[Dimension], unit: &[f64]) -> Vec<f64> {
    dimensions.iter().zip(unit).map(|(d, &x)| d.at(x)).collect()
}
