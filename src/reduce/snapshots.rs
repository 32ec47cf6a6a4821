//! Finite-element solutions over the design, as fields on the nodes of the measured window.

use std::collections::BTreeSet;

use faer::Mat;
use rayon::prelude::*;

use super::design::{Dimension, latin_hypercube};
use super::problem::Problem;
use crate::effect::Seen;
use crate::error::{Error, Result};
use crate::experiment::{ZeroAt, remove_rigid_motion, remove_rigid_motion_of_nodes, settle};
use crate::fem::{Locator, Mesh, Plate};

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

/// Memory of the snapshot matrices of both components, at most, bytes; their decomposition takes about three times it.
const LARGEST: usize = 512 << 20;

fn check_memory(nodes: usize, snapshots: usize) -> Result<()> {
    let each = 2 * nodes * size_of::<f64>();
    if each * snapshots <= LARGEST {
        return Ok(());
    }
    Err(Error::input(
        "reduced_model.snapshots",
        format!("at most {} for {nodes} nodes in the window", LARGEST / each),
    )
    .found(snapshots)
    .hint("more than some hundred gain nothing: the response surfaces are cubic"))
}

impl Snapshots {
    /// Solve over a Latin hypercube of `problem.spec.snapshots` points. `step` is called after each solution.
    pub fn compute(problem: &Problem, plate: &Plate, step: &(dyn Fn() + Sync)) -> Result<Self> {
        let design = latin_hypercube(
            problem.spec.snapshots,
            problem.dimensions.len(),
            DESIGN_SEED,
        );
        let points: Vec<Vec<f64>> = design
            .iter()
            .map(|unit| scale(&problem.dimensions, unit))
            .collect();
        Self::at(problem, plate, points, step)
    }

    /// Solve at given points of the parameter space.
    pub fn at(
        problem: &Problem,
        plate: &Plate,
        points: Vec<Vec<f64>>,
        step: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let nodes = window_nodes(&plate.mesh, problem.window);
        if nodes.is_empty() {
            return Err(Error::input("measurement", "points on the plate")
                .found(format!("{:?}", problem.window)));
        }
        check_memory(nodes.len(), points.len())?;
        let zero = ZeroAt::new(problem.gauge, &problem.frame, plate)?;
        let window = Window {
            problem,
            plate,
            nodes: &nodes,
            zero,
        };
        let solutions: Vec<Vec<[f64; 2]>> = points
            .par_iter()
            .map(|point| {
                let seen = window.seen(point)?;
                step();
                Ok(seen)
            })
            .collect::<Result<_>>()?;
        let fields =
            [0, 1].map(|c| Mat::from_fn(nodes.len(), points.len(), |i, j| solutions[j][i][c]));
        Ok(Self {
            points,
            nodes,
            fields,
        })
    }
}

/// Where solutions are seen: at the nodes of the nominal mesh about the measured window.
struct Window<'a> {
    problem: &'a Problem,
    plate: &'a Plate,
    nodes: &'a [u32],
    zero: Option<ZeroAt>,
}

impl Window<'_> {
    /// Gauged displacements reported at the nodes, with the constants and amplitudes of a point of the DoE. Where an effect
    /// moves nodes into the hole or past an edge, the field is continued.
    fn seen(&self, point: &[f64]) -> Result<Vec<[f64; 2]>> {
        let (setup, ply) = self.problem.test_at(point);
        let mut solution = self.plate.solve(&setup, &ply)?;
        let acting = self.problem.acting(point);
        let seen = Seen::new(&acting, &self.problem.scene);
        match &self.zero {
            Some(zero) => zero.apply(&mut solution),
            None if seen.is_plain() => {
                remove_rigid_motion_of_nodes(&solution.mesh, self.nodes, &mut solution.nodal);
            }
            None => settle(&mut solution, self.problem.window),
        }
        if solution.is_nominal() && seen.is_plain() {
            let u = &solution.nodal;
            let at = |&n: &u32| [u[2 * n as usize], u[2 * n as usize + 1]];
            return Ok(self.nodes.iter().map(at).collect());
        }
        let mesh = &self.plate.mesh;
        let reported: Vec<[f64; 2]> = self.nodes.iter().map(|&n| mesh.nodes[n as usize]).collect();
        let places: Vec<[f64; 2]> = reported.iter().map(|&p| seen.true_point(p)).collect();
        let observer = Locator::new(&solution.mesh).observe_extended(&places);
        let mut u = observer.displacement(&solution.nodal);
        for (u, &p) in u.iter_mut().zip(&reported) {
            *u = seen.components(p, *u);
        }
        if self.zero.is_none() {
            remove_rigid_motion(&reported, &mut u);
        }
        Ok(u)
    }
}

fn scale(dimensions: &[Dimension], unit: &[f64]) -> Vec<f64> {
    dimensions.iter().zip(unit).map(|(d, &x)| d.at(x)).collect()
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
