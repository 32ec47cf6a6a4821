//! Nodal forces of an initial stress.

use nalgebra::Vector3;

use super::element::{self, GAUSS};
use crate::geometry::Mesh;

/// A Gauss point of an element.
pub struct Gauss {
    /// Where it is, mm.
    pub place: [f64; 2],
    /// Gradients of the element's shape functions, 1/mm.
    gradient: [[f64; 2]; 8],
    /// Its weight, mm^2.
    weight: f64,
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
                    gradient,
                    weight: wa * wb * det,
                });
            }
        }
    }
    points
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
    let points = GAUSS.len() * GAUSS.len();
    for (nodes, gauss) in mesh.elements.iter().zip(gauss.chunks(points)) {
        let u = nodes.map(|n| [nodal[2 * n as usize], nodal[2 * n as usize + 1]]);
        for point in gauss {
            let mut strain = Vector3::zeros();
            for (g, u) in point.gradient.iter().zip(u) {
                strain.x += g[0] * u[0];
                strain.y += g[1] * u[1];
                strain.z += g[1] * u[0] + g[0] * u[1];
            }
            let n = resultant(point, &strain) * point.weight;
            for (node, g) in nodes.iter().zip(&point.gradient) {
                force[2 * *node as usize] += g[0] * n.x + g[1] * n.z;
                force[2 * *node as usize + 1] += g[1] * n.y + g[0] * n.z;
            }
        }
    }
}
