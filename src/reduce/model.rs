//! The reduced model: POD modes on the window's nodes and response surfaces of their coefficients.

use serde::{Deserialize, Serialize};

use super::design::Dimension;
use super::pod;
use super::problem::Problem;
use super::snapshots::{Snapshots, design};
use super::surface::Surface;
use super::variables::{Choice, Variables};
use crate::error::Result;
use crate::files::Keyed;
use crate::progress::Progress;

/// A reduced model, as it is saved.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ReducedModel {
    pub dimensions: Vec<Dimension>,
    /// `modes[c][k][i]`: mode k of component c at point i of the experiment's support; orthonormal over a lattice of the window.
    pub modes: [Vec<Vec<f64>>; 2],
    /// Surfaces of the coefficients: those of u1, then those of u2.
    pub surface: Surface,
    /// The article's surface, a polynomial of the parameters as they are, for comparison.
    pub plain: Surface,
    /// Truncation error eps (article Eq. 10) of each component for K = 1, 2, ...
    pub truncation: [Vec<f64>; 2],
    pub snapshots: usize,
    /// Elements and unknowns of the mesh.
    pub mesh_size: [usize; 2],
}

/// Truncations for which error measures are kept.
const TABLED: usize = 12;

impl ReducedModel {
    /// Of a problem: of its design, solved by its finite elements or given.
    ///
    /// # Errors
    /// Those of finite-element solutions and of [`ReducedModel::build`].
    pub fn of(problem: &Problem, progress: &dyn Progress) -> Result<Self> {
        let given = problem.given();
        let rows = given.map_or_else(|| design(problem), |given| given.rows.to_vec());
        progress.begin("finite-element snapshots", Some(rows.len() as u64));
        let snapshots = match given {
            Some(given) => Snapshots::of(problem, rows, given.fields),
            None => Snapshots::at(problem, rows, &|| progress.step())?,
        };
        progress.end();
        progress.begin("modes and response surfaces", None);
        let model = Self::build(problem, &snapshots);
        progress.end();
        model
    }

    /// Build from snapshots: POD of each component, then the response surface with the smaller held-out error.
    pub fn build(problem: &Problem, snapshots: &Snapshots) -> Result<Self> {
        let (first, second) = rayon::join(
            || pod::decompose_as_seen(&snapshots.fields[0], &snapshots.seen[0]),
            || pod::decompose_as_seen(&snapshots.fields[1], &snapshots.seen[1]),
        );
        let pods = [first?, second?];
        let k = problem.spec.modes.resolve(&pods, snapshots.seen[0].nrows());
        let values: Vec<Vec<f64>> = pods
            .iter()
            .flat_map(|pod| {
                let a = pod.coefficients(k);
                (0..k).map(move |j| a.col(j).iter().copied().collect())
            })
            .collect();
        let plain = fit(
            problem,
            Choice::Plain,
            problem.spec.degree,
            &snapshots.points,
            &values,
        )?;
        let surface = best_surface(problem, &plain, &snapshots.points, &values)?;
        Ok(Self {
            dimensions: problem.dimensions.clone(),
            modes: [0, 1].map(|c| {
                (0..k)
                    .map(|j| pods[c].modes.col(j).iter().copied().collect())
                    .collect()
            }),
            surface,
            plain,
            truncation: [0, 1].map(|c| (1..=TABLED).map(|k| pods[c].truncation_error(k)).collect()),
            snapshots: snapshots.points.len(),
            mesh_size: problem.experiment.mesh_size(),
        })
    }

    /// Low and high side of the DoE box, by name.
    pub fn sides(&self) -> Keyed<[f64; 2]> {
        let sides = self.dimensions.iter();
        sides.map(|d| (d.name.clone(), [d.low, d.high])).collect()
    }

    /// Points of the support on which the modes are given.
    pub fn points(&self) -> usize {
        self.modes[0].first().map_or(0, Vec::len)
    }

    /// Modes kept for each component.
    pub fn modes_per_component(&self) -> usize {
        self.modes[0].len()
    }
}

fn fit(
    problem: &Problem,
    choice: Choice,
    degree: usize,
    points: &[Vec<f64>],
    values: &[Vec<f64>],
) -> Result<Surface> {
    let variables = Variables::new(choice, problem, points);
    Surface::fit(variables, degree, points, values)
}

/// The surface with the smallest held-out error: the plain one, or one in the ratios of the declared degree or
/// up to three degrees above it, as long as three snapshots stand behind each monomial. The ratios are fewer than
/// the parameters, so that a quintic in three ratios has no more monomials than a cubic in five parameters.
fn best_surface(
    problem: &Problem,
    plain: &Surface,
    points: &[Vec<f64>],
    values: &[Vec<f64>],
) -> Result<Surface> {
    let mut best = plain.clone();
    for degree in problem.spec.degree..=problem.spec.degree + 3 {
        let dims = Variables::new(Choice::Ratios, problem, points).count();
        if 3 * super::design::exponents(dims, degree).len() > points.len() {
            break;
        }
        let surface = fit(problem, Choice::Ratios, degree, points, values)?;
        if surface.held_out() < best.held_out() {
            best = surface;
        }
    }
    Ok(best)
}

impl Surface {
    /// Held-out error of all surfaces together: root sum of squared PRESS errors, mm.
    pub fn held_out(&self) -> f64 {
        self.quality
            .iter()
            .map(|q| q.press * q.press)
            .sum::<f64>()
            .sqrt()
    }
}
