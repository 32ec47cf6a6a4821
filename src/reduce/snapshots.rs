//! An experiment's prediction over the design, as fields on its support.

use faer::Mat;
use rayon::prelude::*;

use super::design::{Dimension, latin_hypercube};
use super::problem::Problem;
use crate::error::{Error, Result};
use crate::experiment::{FieldSolver, Gauge, PointSet, State, predict};
use crate::field::rigid::{self, RigidMotion};
use crate::numeric::add_scaled;

/// Snapshots of both displacement components.
pub struct Snapshots {
    /// DoE points, border units, one row of `dimensions.len()` values a snapshot.
    pub points: Vec<Vec<f64>>,
    /// u1 and u2 in mm at the experiment's support, each points x snapshots, gauged over a lattice of points of the window.
    pub fields: [Mat<f64>; 2],
    /// The same at that lattice.
    pub seen: [Mat<f64>; 2],
}

/// Points of the lattice along each side of the window: more than there are snapshots, of which modes are made that do not depend on
/// where a mesh has its nodes.
const SIDE: usize = 48;

/// A lattice of points of the specimen over the window.
fn lattice(experiment: &dyn FieldSolver) -> PointSet {
    let [low, high] = experiment.window();
    let at = |k: usize, i: usize| low[k] + (high[k] - low[k]) * (i as f64 + 0.5) / SIDE as f64;
    let points: Vec<[f64; 2]> = (0..SIDE * SIDE)
        .map(|i| [at(0, i / SIDE), at(1, i % SIDE)])
        .collect();
    experiment.locate(&points, &[]).0
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
        let spanned = |state: &State| {
            let answer = experiment.coordinates(state)?;
            Some(sum(&spanning, answer.coordinates.as_slice(), count))
        };
        let solutions: Vec<Vec<[f64; 2]>> = states
            .par_iter()
            .map(|state| {
                let field = match spanned(state) {
                    Some(field) => field,
                    None => predict(experiment, state, support)?.field,
                };
                step();
                Ok(field)
            })
            .collect::<Result<_>>()?;
        Ok(Self::of(problem, points, &solutions))
    }

    /// Of given points of the design the `solutions` at the experiment's support, mm.
    pub fn of(problem: &Problem, points: Vec<Vec<f64>>, solutions: &[Vec<[f64; 2]>]) -> Self {
        let experiment = &*problem.experiment;
        let support = experiment.support();
        let lattice = lattice(experiment);
        let free = experiment.gauge() == Gauge::Window;
        let gauged = |u: &Vec<[f64; 2]>| {
            let seen = experiment.spread(u, &lattice);
            let motion = if free {
                rigid::fit(lattice.points(), &seen)
            } else {
                RigidMotion::NONE
            };
            [
                motion.removed(support.points(), u),
                motion.removed(lattice.points(), &seen),
            ]
        };
        let gauged: Vec<[Vec<[f64; 2]>; 2]> = solutions.par_iter().map(gauged).collect();
        let matrix = |of: usize, c: usize| {
            let rows = gauged.first().map_or(0, |u| u[of].len());
            Mat::from_fn(rows, points.len(), |i, j| gauged[j][of][i][c])
        };
        Self {
            fields: [matrix(0, 0), matrix(0, 1)],
            seen: [matrix(1, 0), matrix(1, 1)],
            points,
        }
    }
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
    rows_over(&problem.dimensions, problem.spec.count(), DESIGN_SEED)
}

/// A Latin hypercube of so many points over a problem's box.
pub fn spread_over(problem: &Problem, count: usize, seed: u64) -> Vec<Vec<f64>> {
    rows_over(&problem.dimensions, count, seed)
}

/// The design that another program is to solve: a Latin hypercube of so many points over a box.
pub fn rows_to_solve(dimensions: &[Dimension], count: usize) -> Vec<Vec<f64>> {
    rows_over(dimensions, count, DESIGN_SEED)
}

fn rows_over(dimensions: &[Dimension], count: usize, seed: u64) -> Vec<Vec<f64>> {
    latin_hypercube(count, dimensions.len(), seed)
        .iter()
        .map(|unit| scale(dimensions, unit))
        .collect()
}

fn scale(dimensions: &[Dimension], unit: &[f64]) -> Vec<f64> {
    dimensions.iter().zip(unit).map(|(d, &x)| d.at(x)).collect()
}
