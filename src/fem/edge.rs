//! Edges as integrals along them see them: points of a quadrature with their shape functions and normals.

use super::element::GAUSS;
use crate::geometry::{Edge, EdgeForce, Mesh};

/// A point of the quadrature on an edge.
pub(super) struct OnEdge {
    /// Shape functions of the edge's three nodes.
    pub shape: [f64; 3],
    pub point: [f64; 2],
    /// Outward unit normal.
    pub normal: [f64; 2],
    /// Length that it stands for, mm.
    pub length: f64,
}

/// The pieces of the edges that a force acts on.
pub(super) fn pieces<'a>(mesh: &'a Mesh, force: &'a EdgeForce) -> impl Iterator<Item = &'a Edge> {
    force.edges.iter().flat_map(|name| mesh.edge(name))
}

/// Points of the quadrature on a piece of an edge.
pub(super) fn gauss(mesh: &Mesh, edge: &Edge) -> [OnEdge; 3] {
    let [a, m, b] = edge.map(|n| mesh.nodes[n as usize]);
    GAUSS.map(|(x, weight)| {
        let shape = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
        let along = [0, 1].map(|k| (x - 0.5) * a[k] - 2.0 * x * m[k] + (x + 0.5) * b[k]);
        let length = along[0].hypot(along[1]);
        OnEdge {
            shape,
            point: [0, 1].map(|k| shape[0] * a[k] + shape[1] * m[k] + shape[2] * b[k]),
            normal: [along[1] / length, -along[0] / length],
            length: weight * length,
        }
    })
}

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// A vector turned by a quarter, from direction 1 to direction 2.
pub(super) fn turned([a, b]: [f64; 2]) -> [f64; 2] {
    [-b, a]
}
