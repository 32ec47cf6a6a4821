//! How a force enters through an edge where that is not known: tractions without a resultant, by which its distribution differs from the
//! declared one.
//!
//! With x the position on the edge, -1 to 1 along its longer side, these are the Legendre polynomials P2, P3, P4 of x along the force and
//! P1, P2, P3 across it, less the part that moves or turns the edge as a whole: what is left of a resultant is the force, and the effects
//! that lean or shift it. Away from the edge the k-th has died out after about 1 / k of its length (Saint-Venant).

use nalgebra::{Matrix3, Vector3};

use super::edge::{OnEdge, dot, gauss, pieces, turned};
use crate::geometry::{Boundary, INTRODUCTIONS, Mesh};

/// Tractions on each of these edges.
pub const TRACTIONS: usize = 6;

/// Amplitudes on each such edge: the resultant, N, of a uniform traction as large as the unit of each.
pub type Introduction = [[f64; TRACTIONS]; INTRODUCTIONS];

/// Add the nodal forces (N) of some amplitudes to those of the nominal tractions.
pub(super) fn add_introductions(
    mesh: &Mesh,
    boundary: &Boundary,
    amplitudes: &Introduction,
    forces: &mut [f64],
) {
    for (edge, amplitudes) in boundary.introductions().zip(amplitudes) {
        if amplitudes.iter().all(|a| *a == 0.0) {
            continue;
        }
        let pieces: Vec<_> = pieces(mesh, edge).collect();
        let nodes = pieces.iter().flat_map(|piece| piece.iter());
        let nodes: Vec<[f64; 2]> = nodes.map(|n| mesh.nodes[*n as usize]).collect();
        let points: Vec<OnEdge> = pieces.iter().flat_map(|e| gauss(mesh, e)).collect();
        let edge = EdgeLine::new(&nodes, edge.direction, &points);
        for ((k, at), traction) in points.iter().enumerate().zip(edge.tractions(amplitudes)) {
            for (node, n) in pieces[k / 3].iter().zip(at.shape) {
                for (i, t) in traction.iter().enumerate() {
                    forces[2 * *node as usize + i] += n * t * at.length;
                }
            }
        }
    }
}

/// An edge, in its own axes: across the force and along it.
struct EdgeLine<'a> {
    points: &'a [OnEdge],
    axes: [[f64; 2]; 2],
    length: f64,
    /// Lowest and highest place along both axes.
    ranges: [[f64; 2]; 2],
}

impl<'a> EdgeLine<'a> {
    fn new(nodes: &[[f64; 2]], direction: [f64; 2], points: &'a [OnEdge]) -> Self {
        let axes = [turned(direction), direction];
        let ranges = axes.map(|axis| {
            let places = nodes.iter().map(|p| dot(*p, axis));
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
        });
        Self {
            points,
            axes,
            length: points.iter().map(|at| at.length).sum(),
            ranges,
        }
    }

    /// The rigid motions at a point, of a size near to 1.
    fn motions(&self, p: [f64; 2]) -> [[f64; 2]; 3] {
        let from = |k: usize| {
            let [low, high] = self.ranges[k];
            (2.0 * dot(p, self.axes[k]) - low - high) / self.length
        };
        [[1.0, 0.0], [0.0, 1.0], [from(1), -from(0)]]
    }

    /// The polynomials of the place at a point, N/mm.
    fn polynomials(&self, amplitudes: &[f64; TRACTIONS], p: [f64; 2]) -> [f64; 2] {
        let [across, along] = self.ranges.map(|[low, high]| high - low);
        let longer = usize::from(along > across);
        let [low, high] = self.ranges[longer];
        let x = (2.0 * dot(p, self.axes[longer]) - low - high) / (high - low);
        let [p1, p2, p3, p4] = legendre(x);
        let sum = |shapes: [f64; 3], amplitudes: &[f64]| {
            let pairs = shapes.iter().zip(amplitudes);
            pairs.map(|(p, a)| p * a).sum::<f64>() / self.length
        };
        [
            sum([p1, p2, p3], &amplitudes[3..]),
            sum([p2, p3, p4], &amplitudes[..3]),
        ]
    }

    /// The tractions at every point, along (direction 1, direction 2), N/mm.
    fn tractions(&self, amplitudes: &[f64; TRACTIONS]) -> Vec<[f64; 2]> {
        let mut gram = Matrix3::<f64>::zeros();
        let mut work = Vector3::<f64>::zeros();
        for at in self.points {
            let motions = self.motions(at.point);
            let traction = self.polynomials(amplitudes, at.point);
            for (i, m) in motions.iter().enumerate() {
                work[i] += at.length * dot(*m, traction);
                for (j, n) in motions.iter().enumerate() {
                    gram[(i, j)] += at.length * dot(*m, *n);
                }
            }
        }
        let rigid = gram.try_inverse().unwrap_or_else(Matrix3::zeros) * work;
        let left = |at: &OnEdge| {
            let mut traction = self.polynomials(amplitudes, at.point);
            for (m, share) in self.motions(at.point).iter().zip(&rigid) {
                for (t, m) in traction.iter_mut().zip(m) {
                    *t -= share * m;
                }
            }
            let [across, along] = self.axes;
            [0, 1].map(|k| traction[0] * across[k] + traction[1] * along[k])
        };
        self.points.iter().map(left).collect()
    }
}

/// P1 to P4.
fn legendre(x: f64) -> [f64; 4] {
    let square = x * x;
    [
        x,
        0.5 * (3.0 * square - 1.0),
        0.5 * x * (5.0 * square - 3.0),
        0.125 * ((35.0 * square - 30.0) * square + 3.0),
    ]
}
