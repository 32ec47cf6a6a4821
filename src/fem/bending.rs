//! Plate bending on a plate's own mesh: sparse stiffness, Cholesky, and the specimen bent by moments at its ends.

use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use nalgebra::{SMatrix, Vector3};

use super::assemble::{node_pattern, pinned_entries, scalar_pattern};
use super::load::edge_forces;
use super::plate_element::{self, PER_NODE, UNKNOWNS};
use super::solve::{Symbolic, not_definite};
use crate::error::Result;
use crate::geometry::{Edge, HIGH, LOW, Mesh};
use crate::laminate::PlateStiffness;

/// Pattern of a mesh's bending matrices and its symbolic factorisation. Unknowns node by node: deflection w (mm), positive
/// towards the face z = +h/2, and rotations theta_1, theta_2 (rad), by which a point at height z moves along u_i = z theta_i.
pub struct BendingPattern {
    /// Lower triangle of the pairs of nodes, by columns.
    first: Vec<usize>,
    row: Vec<u32>,
    /// The same of the unknowns.
    scalar: SymbolicSparseColMat<usize>,
    symbolic: Symbolic,
}

/// A factorised bending stiffness.
pub struct BendingFactor<'a> {
    pattern: &'a BendingPattern,
    factor: Vec<f64>,
    pinned: Vec<usize>,
}

impl BendingPattern {
    /// Analyse a mesh.
    ///
    /// # Errors
    /// A mesh that does not fit into memory.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let (first, row) = node_pattern(mesh, &|n| n);
        let scalar = scalar_pattern(&first, &row, PER_NODE);
        let symbolic = Symbolic::new(scalar.as_ref())?;
        Ok(Self {
            first,
            row,
            scalar,
            symbolic,
        })
    }

    /// Lower triangle of the stiffness matrix of a mesh of this connectivity.
    pub fn stiffness(&self, mesh: &Mesh, plate: &PlateStiffness) -> Vec<f64> {
        self.assembled(mesh, |e| plate_element::stiffness(&mesh.corners(e), plate))
    }

    /// Lower triangle of the sum of symmetric matrices, one an element.
    pub fn assembled(
        &self,
        mesh: &Mesh,
        element: impl Fn(usize) -> SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    ) -> Vec<f64> {
        let starts = self.scalar.col_ptr();
        let mut values = vec![0.0; starts[starts.len() - 1]];
        for (e, nodes) in mesh.elements.iter().enumerate() {
            let matrix = element(e);
            for (j, &b) in nodes.iter().enumerate() {
                let below = self.first[b as usize]..self.first[b as usize + 1];
                for (i, &a) in nodes.iter().enumerate().filter(|(_, a)| **a >= b) {
                    let Ok(k) = self.row[below.clone()].binary_search(&a) else {
                        continue;
                    };
                    for c in 0..PER_NODE {
                        // a column begins at its own diagonal
                        let begin = starts[PER_NODE * b as usize + c] - c + PER_NODE * k;
                        for r in if k == 0 { c } else { 0 }..PER_NODE {
                            values[begin + r] += matrix[(PER_NODE * i + r, PER_NODE * j + c)];
                        }
                    }
                }
            }
        }
        values
    }

    /// A matrix, by its lower triangle, times a vector.
    pub fn multiply(&self, lower: &[f64], u: &[f64]) -> Vec<f64> {
        let (starts, rows) = (self.scalar.col_ptr(), self.scalar.row_idx());
        let mut product = vec![0.0; u.len()];
        for column in 0..u.len() {
            for entry in starts[column]..starts[column + 1] {
                let row = rows[entry];
                product[row] += lower[entry] * u[column];
                if row != column {
                    product[column] += lower[entry] * u[row];
                }
            }
        }
        product
    }

    /// Factorise a matrix, by its lower triangle, with some unknowns held at zero.
    ///
    /// # Errors
    /// Of the input, where the matrix is not positive definite.
    pub fn factorise(&self, mut lower: Vec<f64>, pinned: &[usize]) -> Result<BendingFactor<'_>> {
        let (cleared, unit) = pinned_entries(&self.scalar, pinned);
        for entry in cleared {
            lower[entry] = 0.0;
        }
        for entry in unit {
            lower[entry] = 1.0;
        }
        let matrix = SparseColMatRef::new(self.scalar.as_ref(), &lower);
        let factor = self.symbolic.factorised(matrix);
        Ok(BendingFactor {
            pattern: self,
            factor: factor.ok_or_else(|| not_definite("its bending"))?,
            pinned: pinned.to_vec(),
        })
    }
}

impl BendingFactor<'_> {
    /// Solve for loads (N, N mm, N mm a node; one vector after the other), in place.
    pub fn solve(&self, loads: &mut [f64]) {
        for load in loads.chunks_mut(self.pattern.scalar.nrows()) {
            for &dof in &self.pinned {
                load[dof] = 0.0;
            }
        }
        self.pattern.symbolic.solve(&self.factor, loads);
    }
}

/// A moment M1 about direction 2 that acts on the whole specimen through the edges `low` and `high`, per length of the parallel
/// part's width: M1 = moment + gradient s, s from the origin, with the shear force at both ends that a gradient needs.
#[derive(Debug, Clone, Copy)]
pub struct EndMoment {
    /// N mm a mm.
    pub moment: f64,
    /// N mm a mm, a mm along direction 1.
    pub gradient: f64,
}

impl EndMoment {
    /// The load that bends a specimen without a hole by a curvature kappa_1 of `curvature`\[0\] + `curvature`\[1\] s, 1/mm and 1/mm^2.
    pub fn bending(plate: &PlateStiffness, curvature: [f64; 2]) -> Self {
        let per_moment = plate.curvature(&Vector3::x()).x;
        Self {
            moment: curvature[0] / per_moment,
            gradient: curvature[1] / per_moment,
        }
    }

    /// Consistent nodal loads: N, N mm, N mm a node.
    pub fn forces(&self, mesh: &Mesh) -> Vec<f64> {
        let [_, [t0, t1]] = mesh.extents;
        let mut forces = vec![0.0; PER_NODE * mesh.nodes.len()];
        for name in [LOW, HIGH] {
            // an end that is wider than the parallel part carries the same resultant
            let share = (t1 - t0) / mesh.edge(name).iter().map(|e| chord(mesh, e)).sum::<f64>();
            let moments = edge_forces(mesh, &[name], &|[s, _], [outward, _]| {
                [share * outward * (self.moment + self.gradient * s), 0.0]
            });
            let shear = edge_forces(mesh, &[name], &|_, [outward, _]| {
                [share * outward * self.gradient, 0.0]
            });
            let own = moments.chunks(2).zip(shear.chunks(2));
            for (force, (moment, shear)) in forces.chunks_mut(PER_NODE).zip(own) {
                force[0] += shear[0];
                force[1] += moment[0];
            }
        }
        forces
    }
}

/// Length of an edge from corner to corner, mm.
fn chord(mesh: &Mesh, [a, _, b]: &Edge) -> f64 {
    let [a, b] = [a, b].map(|n| mesh.nodes[*n as usize]);
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// A bent plate, up to its rigid motion.
#[derive(Debug)]
pub struct Bent {
    /// Deflection w towards the face z = +h/2, mm, one a node.
    pub deflection: Vec<f64>,
    /// Rotations theta_1, theta_2, rad, two a node: the displacement of the face z over z.
    pub rotation: Vec<f64>,
}

/// The plate of a mesh bent by each of some loads. Its rigid motion is held at the node nearest to the origin, without stress.
///
/// # Errors
/// Those of [`BendingPattern::new`] and [`BendingPattern::factorise`].
pub fn bend(mesh: &Mesh, plate: &PlateStiffness, loads: &[EndMoment]) -> Result<Vec<Bent>> {
    let pattern = BendingPattern::new(mesh)?;
    let far = |p: &[f64; 2]| p[0].hypot(p[1]);
    let nearest = (0..mesh.nodes.len())
        .min_by(|&a, &b| far(&mesh.nodes[a]).total_cmp(&far(&mesh.nodes[b])))
        .unwrap_or(0);
    let pinned = [0, 1, 2].map(|c| PER_NODE * nearest + c);
    let factor = pattern.factorise(pattern.stiffness(mesh, plate), &pinned)?;
    let mut all: Vec<f64> = loads.iter().flat_map(|load| load.forces(mesh)).collect();
    factor.solve(&mut all);
    let bent = |u: &[f64]| Bent {
        deflection: u.chunks(PER_NODE).map(|u| u[0]).collect(),
        rotation: u.chunks(PER_NODE).flat_map(|u| [u[1], u[2]]).collect(),
    };
    Ok(all.chunks(PER_NODE * mesh.nodes.len()).map(bent).collect())
}

/// Rotations theta_1, theta_2 (rad) at (s, t), measured from the middle of the width, of a thin plate without a hole whose curvature
/// along direction 1 is `curvature`\[0\] + `curvature`\[1\] s. The sides are free: M2 = 0 and, for the part that grows along s, no effective shear
/// Q2 + dM12/ds; the twisting moment M12 that grows with t is balanced along the sides and at the corners. That part is the gradient of
/// -w with w = -(s^3 + 3/2 k12 s^2 t + 3 k2 s t^2 + k222 t^3) / 6.
pub fn plain_rotation(plate: &PlateStiffness, curvature: [f64; 2], [s, t]: [f64; 2]) -> [f64; 2] {
    let [k2, k12, k222] = plain_curvatures(plate);
    let [uniform, gradient] = curvature;
    [
        uniform * (s + 0.5 * k12 * t) + gradient * 0.5 * (s * s + k12 * s * t + k2 * t * t),
        uniform * (0.5 * k12 * s + k2 * t)
            + gradient * (0.25 * k12 * s * s + k2 * s * t + 0.5 * k222 * t * t),
    ]
}

/// k2, k12 and k222 of [`plain_rotation`].
fn plain_curvatures(plate: &PlateStiffness) -> [f64; 3] {
    let d = &plate.bending;
    let kappa = plate.curvature(&Vector3::x());
    let (k2, k12) = (kappa.y / kappa.x, kappa.z / kappa.x);
    let k222 = -(0.5 * d[(0, 1)] * k12 + 2.0 * d[(1, 2)] * k2) / d[(1, 1)];
    [k2, k12, k222]
}

/// Deflection, mm, of which the part of [`plain_rotation`] that grows along direction 1 by 1/mm^2 is the negative gradient.
pub fn plain_deflection(plate: &PlateStiffness, [s, t]: [f64; 2]) -> f64 {
    let [k2, k12, k222] = plain_curvatures(plate);
    -(s.powi(3) + 1.5 * k12 * s * s * t + 3.0 * k2 * s * t * t + k222 * t.powi(3)) / 6.0
}
