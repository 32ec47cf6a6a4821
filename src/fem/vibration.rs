//! Natural modes of a plate on its own mesh, by subspace iteration (K.-J. Bathe, Finite Element Procedures, section 11.6).

use nalgebra::{DMatrix, SMatrix};

use super::bending::BendingPattern;
use super::element::{self, GAUSS};
use super::plate_element::{PER_NODE, UNKNOWNS};
use crate::dense::eigen;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::laminate::PlateStiffness;

/// What vibrates: N, mm, t, s.
#[derive(Debug, Clone, Copy)]
pub struct Vibrating<'a> {
    pub mesh: &'a Mesh,
    pub plate: PlateStiffness,
    /// t/mm^2.
    pub mass_per_area: f64,
    /// Of the rotary inertia, mm.
    pub thickness: f64,
    /// Unknowns that are held at zero: w, theta_1, theta_2 node by node.
    pub pinned: &'a [usize],
}

/// Modes by increasing frequency.
pub struct NaturalModes {
    /// Squares of the angular frequencies, 1/s^2; those of rigid motions are zero but for rounding.
    pub lambda: Vec<f64>,
    /// Unknowns node by node, of unit modal mass; a column a mode.
    pub shapes: DMatrix<f64>,
    /// The mass times them.
    pub images: DMatrix<f64>,
}

impl Vibrating<'_> {
    /// As many modes as there are columns of `start` (unknowns x modes), which are about what they span; the last few are less exact than
    /// the others, to which they lend their span. `shift` (1/s^2) is of the order of the lowest lambda: a free plate has no stiffness against
    /// rigid motion.
    ///
    /// # Errors
    /// The input's fault: constants without stiffness; the program's if the iteration does not settle.
    pub fn modes(&self, start: &DMatrix<f64>, shift: f64, exact: usize) -> Result<NaturalModes> {
        /// Relative change of the lambdas that are asked for.
        const SETTLED: f64 = 1e-9;
        const MOST: usize = 60;
        let pattern = BendingPattern::new(self.mesh)?;
        let stiffness = pattern.stiffness(self.mesh, &self.plate);
        let mass = pattern.assembled(self.mesh, |e| self.element_mass(&self.mesh.corners(e)));
        let shifted = stiffness.iter().zip(&mass).map(|(k, m)| k + shift * m);
        let factor = pattern.factorise(shifted.collect(), self.pinned)?;
        let times_mass = |v: &DMatrix<f64>| {
            let columns: Vec<Vec<f64>> = v
                .column_iter()
                .map(|c| pattern.multiply(&mass, c.as_slice()))
                .collect();
            DMatrix::from_fn(v.nrows(), v.ncols(), |i, j| columns[j][i])
        };
        let mut images = times_mass(start);
        let mut before = vec![f64::INFINITY; exact];
        for _ in 0..MOST {
            let mut shapes = images.clone();
            factor.solve(shapes.as_mut_slice());
            // in their span (K + s M) V = M V_old, so that V' (K + s M) V needs no product
            let inner = symmetric(&shapes.tr_mul(&images));
            images = times_mass(&shapes);
            let (lambda, turn) = lowest(&inner, &symmetric(&shapes.tr_mul(&images)))?;
            let (shapes, turned) = (shapes * &turn, &images * &turn);
            images = turned;
            let now: Vec<f64> = lambda.iter().map(|l| l - shift).collect();
            let change = |(now, before): (&f64, &f64)| (now - before).abs() / (now.abs() + shift);
            let largest = now.iter().zip(&before).map(change).fold(0.0, f64::max);
            if largest < SETTLED {
                return Ok(NaturalModes {
                    lambda: now,
                    shapes,
                    images,
                });
            }
            before = now[..exact.min(now.len())].to_vec();
        }
        Err(Error::program("natural modes", "an iteration that settles").found(MOST))
    }

    /// Consistent mass of an element: of the deflection, and of the rotations by the thickness.
    fn element_mass(&self, x: &[[f64; 2]; 8]) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
        let rotary = self.thickness * self.thickness / 12.0;
        let mut mass = SMatrix::zeros();
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let j = element::jacobian(x, &element::shape_gradient(a, b));
                let det = element::determinant(&j);
                let here = self.mass_per_area * wa * wb * det;
                let n = element::shape(a, b);
                for (i, left) in n.iter().enumerate() {
                    for (k, right) in n.iter().enumerate() {
                        let (row, column) = (PER_NODE * i, PER_NODE * k);
                        let both = here * left * right;
                        mass[(row, column)] += both;
                        mass[(row + 1, column + 1)] += both * rotary;
                        mass[(row + 2, column + 2)] += both * rotary;
                    }
                }
            }
        }
        mass
    }
}

fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

/// Eigenvalues, increasing, and vectors of unit mass of a small pair.
fn lowest(k: &DMatrix<f64>, m: &DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>)> {
    let dependent = || Error::program("natural modes", "a span of independent vectors");
    let root = m.clone().cholesky().ok_or_else(dependent)?.l();
    let half = root.solve_lower_triangular(k).ok_or_else(dependent)?;
    let whole = root.solve_lower_triangular(&half.transpose());
    let (lambda, vectors) = eigen(&symmetric(&whole.ok_or_else(dependent)?))?;
    let turn = root
        .tr_solve_lower_triangular(&vectors)
        .ok_or_else(dependent)?;
    Ok((lambda.iter().copied().collect(), turn))
}
