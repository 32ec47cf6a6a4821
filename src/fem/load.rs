//! Tractions on named edges and the load vectors they give.

use super::edge::{OnEdge, dot, gauss, pieces, turned};
use super::introduction::{Introduction, TRACTIONS, add_introductions};
use crate::geometry::{Boundary, EdgeForce, HIGH, INTRODUCTIONS, LOW, Mesh};

/// Self-equilibrated tractions on the edges `low` and `high`. Stress resultants a length of edge, with t' measured from the plate's
/// centreline, s' from its mid-length, and W the width:
/// N11 = axial / W + 12 (moment + shear s') t' / W^3, N12 = 3/2 shear / W (1 - 4 t'^2 / W^2).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EndLoad {
    /// Axial resultant, N.
    pub axial: f64,
    /// Shear resultant along direction 2 on the edge `high`, N, with the moments at both ends that balance it.
    pub shear: f64,
    /// Moment of N11 about the centreline, the same along the plate, N mm.
    pub moment: f64,
    /// Tractions without a resultant on edges of a mesh whose load introduction is not known.
    pub introduction: Introduction,
}

/// The resultants and amplitudes that a load is made of.
const PARTS: usize = 3 + INTRODUCTIONS * TRACTIONS;

impl EndLoad {
    /// The same load times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            axial: factor * self.axial,
            shear: factor * self.shear,
            moment: factor * self.moment,
            introduction: self.introduction.map(|edge| edge.map(|a| factor * a)),
        }
    }

    /// What it is made of: axial force, shear force, moment, and the amplitudes of the tractions on each edge.
    pub fn parts(&self) -> [f64; PARTS] {
        let mut parts = [0.0; PARTS];
        parts[..3].copy_from_slice(&[self.axial, self.shear, self.moment]);
        parts[3..].copy_from_slice(self.introduction.as_flattened());
        parts
    }

    /// A unit of one of these.
    pub fn unit(part: usize) -> Self {
        let one = |k: usize| f64::from(k == part);
        let [axial, shear, moment] = [0, 1, 2].map(one);
        let mut introduction = Introduction::default();
        for (k, a) in introduction.as_flattened_mut().iter_mut().enumerate() {
            *a = one(3 + k);
        }
        Self {
            axial,
            shear,
            moment,
            introduction,
        }
    }
}

/// How many of a load's parts can act on it, the first ones.
pub fn load_parts(mesh: &Mesh) -> usize {
    3 + TRACTIONS * mesh.introductions()
}

/// Consistent nodal forces (N, two an entry of `nodes`) of the end tractions, or of what stands for them at the edges that an
/// imported mesh is loaded through.
pub fn end_forces(mesh: &Mesh, load: &EndLoad) -> Vec<f64> {
    if let Some(boundary) = &mesh.boundary {
        return named_forces(mesh, boundary, load);
    }
    let [[s0, s1], [t0, t1]] = mesh.extents;
    let width = t1 - t0;
    let (center_t, half) = (0.5 * (t0 + t1), 0.5 * (s1 - s0));
    edge_forces(mesh, &[HIGH, LOW], &|[_, t], [outward, _]| {
        let t = t - center_t;
        let moment = load.moment + load.shear * outward * half;
        let normal = load.axial / width + 12.0 * moment * t / width.powi(3);
        let tangent = 1.5 * load.shear / width * (1.0 - (2.0 * t / width).powi(2));
        [outward * normal, outward * tangent]
    })
}

/// The axial force along each loaded edge's own direction, uniform; the shear force across it, uniform too; the moment by a
/// traction along the direction that is linear across it. Loads that no support holds get the moments that balance the shear forces,
/// shared alike.
fn named_forces(mesh: &Mesh, boundary: &Boundary, load: &EndLoad) -> Vec<f64> {
    let Some(first) = boundary.loads.first() else {
        return vec![0.0; mesh.unknowns()];
    };
    let across = turned(first.direction);
    let sections: Vec<EdgeSection> = boundary
        .loads
        .iter()
        .map(|l| section(mesh, l, across))
        .collect();
    let shears = boundary.loads.iter().map(|l| {
        let outward = dot(l.direction, first.direction).signum();
        across.map(|x| outward * load.shear * x)
    });
    let couples = sections.iter().zip(shears.clone());
    let couple: f64 = couples
        .map(|(at, f)| at.middle[0] * f[1] - at.middle[1] * f[0])
        .sum();
    let balance = if boundary.held.is_empty() {
        couple / sections.len() as f64
    } else {
        0.0
    };
    let mut forces = vec![0.0; mesh.unknowns()];
    for ((edge, section), shear) in boundary.loads.iter().zip(&sections).zip(shears) {
        let outward = dot(edge.direction, first.direction).signum();
        // a traction t along d at the distance x from the middle turns by -t x, with d the first load's
        let moment = load.moment + outward * balance;
        let names: Vec<&str> = edge.edges.iter().map(String::as_str).collect();
        let own = edge_forces(mesh, &names, &|p, _| {
            let x = dot([p[0] - section.middle[0], p[1] - section.middle[1]], across);
            let bent = if section.inertia > 0.0 {
                moment * x / section.inertia
            } else {
                0.0
            };
            let pull = load.axial / section.length + bent;
            [0, 1].map(|k| pull * edge.direction[k] + shear[k] / section.length)
        });
        for (sum, f) in forces.iter_mut().zip(own) {
            *sum += f;
        }
    }
    add_introductions(mesh, boundary, &load.introduction, &mut forces);
    forces
}

/// Length, middle and second moment of the edges that a force acts on, measured along a direction.
fn section(mesh: &Mesh, force: &EdgeForce, across: [f64; 2]) -> EdgeSection {
    let points: Vec<OnEdge> = pieces(mesh, force).flat_map(|e| gauss(mesh, e)).collect();
    let length: f64 = points.iter().map(|p| p.length).sum();
    let mean = |k: usize| points.iter().map(|p| p.length * p.point[k]).sum::<f64>() / length;
    let middle = [mean(0), mean(1)];
    let inertia = points.iter().map(|p| {
        let from = [p.point[0] - middle[0], p.point[1] - middle[1]];
        p.length * dot(from, across).powi(2)
    });
    EdgeSection {
        length,
        middle,
        inertia: inertia.sum(),
    }
}

/// Consistent nodal forces (N, two an entry of `nodes`) of a traction on named edges: `traction(point, outward unit
/// normal)` in N/mm. Exact for straight edges: 3-point Gauss integrates a quadratic traction times a quadratic shape
/// function.
pub fn edge_forces(
    mesh: &Mesh,
    names: &[&str],
    traction: &dyn Fn([f64; 2], [f64; 2]) -> [f64; 2],
) -> Vec<f64> {
    let mut forces = vec![0.0; mesh.unknowns()];
    for edge in names.iter().flat_map(|name| mesh.edge(name)) {
        for at in gauss(mesh, edge) {
            let force = traction(at.point, at.normal).map(|t| t * at.length);
            for (node, n) in edge.iter().zip(at.shape) {
                forces[2 * *node as usize] += n * force[0];
                forces[2 * *node as usize + 1] += n * force[1];
            }
        }
    }
    forces
}

/// What a force is spread over.
struct EdgeSection {
    length: f64,
    middle: [f64; 2],
    /// Second moment across the force, mm^3.
    inertia: f64,
}
