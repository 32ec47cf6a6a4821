//! Nodal forces of an initial stress.

use nalgebra::Vector3;

use super::element::{self, GAUSS};
use crate::geometry::Mesh;

/// A Gauss point of an element.
pub struct Gauss {
    /// Where it is, mm.
    pub place: [f64; 2],
    /// The stack there, as [`Mesh::region`].
    pub stack: usize,
    /// Gradients of the element's shape functions, 1/mm.
    gradient: [[f64; 2]; 8],
    /// Its weight, mm^2.
    pub(super) weight: f64,
}

/// Gauss points of all elements, those of an element together.
pub fn gauss_points(mesh: &Mesh) -> Vec<Gauss> {
    let mut points = Vec::with_capacity(9 * mesh.elements.len());
    for e in 0..mesh.elements.len() {
        let x = mesh.corners(e);
        for (a, wa) in GAUSS {
            for (b, wb) in GAUSS {
                let (gradient, det) = element::physical_gradient(&x, a, b);
                points.push(Gauss {
                    place: element::position(&x, &element::shape(a, b)),
                    stack: mesh.region_of(e),
                    gradient,
                    weight: wa * wb * det,
                });
            }
        }
    }
    points
}

impl Gauss {
    /// Strain (e11, e22, gamma12) for the displacements of its element's nodes, mm.
    fn strain(&self, u: &[[f64; 2]; 8]) -> Vector3<f64> {
        let mut strain = Vector3::zeros();
        for (g, u) in self.gradient.iter().zip(u) {
            strain.x += g[0] * u[0];
            strain.y += g[1] * u[1];
            strain.z += g[1] * u[0] + g[0] * u[1];
        }
        strain
    }

    /// Add the nodal forces of stress resultants (N/mm) here.
    fn add_forces(&self, nodes: &[u32; 8], resultant: &Vector3<f64>, force: &mut [f64]) {
        let n = resultant * self.weight;
        for (node, g) in nodes.iter().zip(&self.gradient) {
            force[2 * *node as usize] += g[0] * n.x + g[1] * n.z;
            force[2 * *node as usize + 1] += g[1] * n.y + g[0] * n.z;
        }
    }
}

/// Gauss points of an element.
const POINTS: usize = GAUSS.len() * GAUSS.len();

/// Displacements of an element's nodes.
fn own(nodes: &[u32; 8], nodal: &[f64]) -> [[f64; 2]; 8] {
    nodes.map(|n| [nodal[2 * n as usize], nodal[2 * n as usize + 1]])
}

/// Strains (e11, e22, gamma12) at all Gauss points under the displacements `nodal`.
pub fn strains(mesh: &Mesh, gauss: &[Gauss], nodal: &[f64]) -> Vec<Vector3<f64>> {
    let elements = mesh.elements.iter().zip(gauss.chunks(POINTS));
    let of = |(nodes, points): (&[u32; 8], &[Gauss])| {
        let u = own(nodes, nodal);
        points.iter().map(|p| p.strain(&u)).collect::<Vec<_>>()
    };
    elements.flat_map(of).collect()
}

/// Nodal forces, integral of B' N, of stress resultants N11, N22, N12 (N/mm) at all Gauss points.
pub fn forces_of(mesh: &Mesh, gauss: &[Gauss], resultants: &[Vector3<f64>]) -> Vec<f64> {
    let mut force = vec![0.0; mesh.unknowns()];
    let points = gauss.chunks(POINTS).zip(resultants.chunks(POINTS));
    for (nodes, (gauss, resultants)) in mesh.elements.iter().zip(points) {
        for (point, resultant) in gauss.iter().zip(resultants) {
            if *resultant != Vector3::zeros() {
                point.add_forces(nodes, resultant, &mut force);
            }
        }
    }
    force
}

/// Add to `force` the nodal forces, integral of B' N, of stress resultants N11, N22, N12 (N/mm) that depend on the Gauss point and the
/// strain there under the displacements `nodal`.
pub fn add_forces(
    mesh: &Mesh,
    gauss: &[Gauss],
    nodal: &[f64],
    resultant: &dyn Fn(&Gauss, &Vector3<f64>) -> Vector3<f64>,
    force: &mut [f64],
) {
    for (nodes, gauss) in mesh.elements.iter().zip(gauss.chunks(POINTS)) {
        let u = own(nodes, nodal);
        for point in gauss {
            point.add_forces(nodes, &resultant(point, &point.strain(&u)), force);
        }
    }
}
