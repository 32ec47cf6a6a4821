//! Finite-element solutions over the design, as fields on the nodes of the measured window.

use std::collections::BTreeSet;

use faer::Mat;
use rayon::prelude::*;

use super::design::{Dimension, latin_hypercube};
use super::gauge::{ZeroAt, remove_rigid_motion_of_nodes};
use super::problem::Problem;
use crate::error::{Error, Result};
use crate::fem::{Factor, Mesh, Plate};

/// Snapshots of both displacement components.
pub struct Snapshots {
    /// DoE points, border units, one row of `dimensions.len()` values a snapshot.
    pub points: Vec<Vec<f64>>,
    /// Nodes of the elements that touch the window.
    pub nodes: Vec<u32>,
    /// u1 and u2 in mm, each nodes x snapshots, gauged.
    pub fields: [Mat<f64>; 2],
}

/// Design seed: the reduced model does not depend on the seed of the chains.
const DESIGN_SEED: u64 = 2013;

impl Snapshots {
    /// Solve over a Latin hypercube of `problem.spec.snapshots` points. `tick` is called after each solution.
    pub fn compute(problem: &Problem, plate: &Plate, tick: &(dyn Fn() + Sync)) -> Result<Self> {
        let design = latin_hypercube(
            problem.spec.snapshots,
            problem.dimensions.len(),
            DESIGN_SEED,
        );
        let points: Vec<Vec<f64>> = design
            .iter()
            .map(|unit| scale(&problem.dimensions, unit))
            .collect();
        Self::at(problem, plate, points, tick)
    }

    /// Solve at given points of the parameter space.
    pub fn at(
        problem: &Problem,
        plate: &Plate,
        points: Vec<Vec<f64>>,
        tick: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let nodes = window_nodes(&plate.mesh, problem.window);
        if nodes.is_empty() {
            return Err(Error::input("measurement", "points on the plate")
                .found(format!("{:?}", problem.window)));
        }
        let zero = ZeroAt::new(problem.gauge, &problem.frame, &plate.mesh)?;
        let solutions: Vec<Vec<f64>> = points
            .par_iter()
            .map_init(
                || plate.factor(),
                |factor, point| {
                    let mut u = solve(problem, plate, factor, point)?;
                    match &zero {
                        Some(zero) => zero.apply(&plate.mesh, &mut u),
                        None => remove_rigid_motion_of_nodes(&plate.mesh, &nodes, &mut u),
                    }
                    tick();
                    Ok(nodes
                        .iter()
                        .flat_map(|&n| [u[2 * n as usize], u[2 * n as usize + 1]])
                        .collect())
                },
            )
            .collect::<Result<_>>()?;
        let fields =
            [0, 1].map(|c| Mat::from_fn(nodes.len(), points.len(), |i, j| solutions[j][2 * i + c]));
        Ok(Self {
            points,
            nodes,
            fields,
        })
    }
}

fn scale(dimensions: &[Dimension], unit: &[f64]) -> Vec<f64> {
    dimensions.iter().zip(unit).map(|(d, &x)| d.at(x)).collect()
}

fn solve(
    problem: &Problem,
    plate: &Plate,
    factor: &mut Factor<'_>,
    point: &[f64],
) -> Result<Vec<f64>> {
    let (setup, ply) = problem.test_at(point);
    factor.factorise(&setup.membrane(&ply))?;
    let mut u = plate.mesh.end_forces(&setup.load);
    factor.solve(&mut u);
    Ok(u)
}

/// Nodes of all elements whose bounding box meets the window, in increasing order.
fn window_nodes(mesh: &Mesh, [low, high]: [[f64; 2]; 2]) -> Vec<u32> {
    let mut nodes = BTreeSet::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let x = mesh.corners(e);
        let outside = (0..2).any(|k| {
            let (min, max) = x
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p[k]), b.max(p[k]))
                });
            let margin = 0.125 * (max - min) + 1e-6;
            max + margin < low[k] || min - margin > high[k]
        });
        if !outside {
            nodes.extend(element);
        }
    }
    nodes.into_iter().collect()
}
