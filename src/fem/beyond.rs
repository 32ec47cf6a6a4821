//! The field a little outside the mesh, in the hole or across an edge.

use nalgebra::{SMatrix, SVector};
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::geometry::Mesh;

/// Value and gradient at a point outside the mesh, as weights of nodal values.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Nodes, and the weights of the value and of its derivatives along both directions.
    pub nodes: Vec<(u32, [f64; 3])>,
}

impl Patch {
    /// The field (0), or its derivative along direction 1 (1) or 2 (2), from nodal values, two a node.
    pub fn derivative(&self, nodal: &[f64], which: usize) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (node, weights) in &self.nodes {
            sum[0] += weights[which] * nodal[2 * *node as usize];
            sum[1] += weights[which] * nodal[2 * *node as usize + 1];
        }
        sum
    }
}

/// Finds nodes near a point.
pub struct Nearby {
    tree: RTree<GeomWithData<[f64; 2], u32>>,
}

/// Fewest and most nodes that a cubic is fitted to; it has ten coefficients.
const NODES: [usize; 2] = [40, 160];

/// Half the elements over which a patch reaches, with room for rounding: five lines of nodes determine a cubic.
const ELEMENTS: f64 = 1.05;

impl Nearby {
    /// Index the nodes of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let nodes = mesh.nodes.iter().zip(0..);
        Self {
            tree: RTree::bulk_load(nodes.map(|(&p, k)| GeomWithData::new(p, k)).collect()),
        }
    }

    /// The node nearest to a point.
    pub fn nearest(&self, point: [f64; 2]) -> [f64; 2] {
        self.tree
            .nearest_neighbor(point)
            .map_or(point, |node| *node.geom())
    }

    /// The cubic fitted by least squares to the nodes about the `nearest` one, as far as twice the distance to it or two
    /// elements (of extent `size`, mm), at `point`. An element's own polynomial would carry its errors many element
    /// lengths: at the hole the elements are far smaller than the way.
    pub fn patch(&self, point: [f64; 2], nearest: [f64; 2], size: f64) -> Patch {
        let reach = 2.0 * distance(nearest, point).max(ELEMENTS * size);
        let around: Vec<([f64; 2], u32)> = self
            .tree
            .nearest_neighbor_iter(nearest)
            .enumerate()
            .take_while(|(k, node)| *k < NODES[0] || distance(*node.geom(), nearest) <= reach)
            .map(|(_, node)| (*node.geom(), node.data))
            .collect();
        let stride = around.len().div_ceil(NODES[1]).max(1);
        let scale = around.last().map_or(1.0, |(p, _)| distance(*p, nearest));
        let local = |p: [f64; 2]| [0, 1].map(|k| (p[k] - nearest[k]) / scale);
        let rows: Vec<(u32, Vector)> = around
            .iter()
            .step_by(stride)
            .map(|(p, node)| (*node, cubic(local(*p))))
            .collect();
        let mut gram = SMatrix::<f64, 10, 10>::zeros();
        for (_, row) in &rows {
            gram += row * row.transpose();
        }
        let wanted = cubic_and_gradient(local(point));
        let fit = match gram.cholesky() {
            Some(factor) => wanted.map(|basis| factor.solve(&basis)),
            // Nodes that do not determine a cubic: the shortest of the coefficients that fit.
            None => match gram.pseudo_inverse(RANK * gram.trace()) {
                Ok(inverse) => wanted.map(|basis| inverse * basis),
                Err(_) => [Vector::zeros(); 3],
            },
        };
        let weights = |row: &Vector| {
            [
                fit[0].dot(row),
                fit[1].dot(row) / scale,
                fit[2].dot(row) / scale,
            ]
        };
        Patch {
            nodes: rows
                .iter()
                .map(|(node, row)| (*node, weights(row)))
                .collect(),
        }
    }
}

/// Singular values below this share of the trace count as 0.
const RANK: f64 = 1e-13;

type Vector = SVector<f64, 10>;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// All monomials to degree 3.
fn cubic([x, y]: [f64; 2]) -> Vector {
    let (xx, xy, yy) = (x * x, x * y, y * y);
    SVector::from([1.0, x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y])
}

/// All monomials to degree 3, and their derivatives.
fn cubic_and_gradient([x, y]: [f64; 2]) -> [Vector; 3] {
    let (xx, xy, yy) = (x * x, x * y, y * y);
    [
        cubic([x, y]),
        SVector::from([0.0, 1.0, 0.0, 2.0 * x, y, 0.0, 3.0 * xx, 2.0 * xy, yy, 0.0]),
        SVector::from([0.0, 0.0, 1.0, 0.0, x, 2.0 * y, 0.0, xx, 2.0 * xy, 3.0 * yy]),
    ]
}
