//! Tractions on the two ends and the load vectors they give.

use super::mesh::Mesh;

/// Self-equilibrated end tractions. Stress resultants a length of edge, with t' measured from the plate's
/// centreline, s' from its mid-length, and W the width:
/// N11 = axial / W + 12 (moment + shear s') t' / W^3, N12 = 3/2 shear / W (1 - 4 t'^2 / W^2).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EndLoad {
    /// Axial resultant, N.
    pub axial: f64,
    /// Shear resultant along direction 2 on the end s = high, N, with the end moments that balance it.
    pub shear: f64,
    /// Moment of N11 about the centreline, the same along the plate, N mm.
    pub moment: f64,
}

impl Mesh {
    /// Consistent nodal forces (N, two an entry of `nodes`) of the end tractions, exact for edges that stay
    /// straight: 3-point Gauss integrates a quadratic traction times a quadratic shape function.
    pub fn end_forces(&self, load: &EndLoad) -> Vec<f64> {
        let mut forces = vec![0.0; self.unknowns()];
        let [t0, t1] = self.outline.t;
        let [s0, s1] = self.outline.s;
        let width = t1 - t0;
        let (center_t, half) = (0.5 * (t0 + t1), 0.5 * (s1 - s0));
        for (edges, outward) in self.ends.iter().zip([1.0, -1.0]) {
            let moment = load.moment + load.shear * outward * half;
            for edge in edges {
                let [a, m, b] = edge.map(|n| self.nodes[n as usize][1]);
                for (x, weight) in super::element::GAUSS {
                    let n = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
                    let dt = weight * ((x - 0.5) * a - 2.0 * x * m + (x + 0.5) * b);
                    let t = n[0] * a + n[1] * m + n[2] * b - center_t;
                    let normal = load.axial / width + 12.0 * moment * t / width.powi(3);
                    let tangent = 1.5 * load.shear / width * (1.0 - (2.0 * t / width).powi(2));
                    for (node, n) in edge.iter().zip(n) {
                        forces[2 * *node as usize] += outward * normal * n * dt;
                        forces[2 * *node as usize + 1] += outward * tangent * n * dt;
                    }
                }
            }
        }
        forces
    }

    /// Consistent nodal forces (N, two an entry of `nodes`) of a traction on the whole outer edge:
    /// `traction(point, outward unit normal)` in N/mm. 3-point Gauss on every element edge.
    pub fn edge_forces(&self, traction: &dyn Fn([f64; 2], [f64; 2]) -> [f64; 2]) -> Vec<f64> {
        let mut forces = vec![0.0; self.unknowns()];
        for (edge, normal) in self.outer_edges() {
            let [a, m, b] = edge.map(|n| self.nodes[n as usize]);
            for (x, weight) in super::element::GAUSS {
                let n = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
                let along = [0, 1].map(|k| (x - 0.5) * a[k] - 2.0 * x * m[k] + (x + 0.5) * b[k]);
                let point = [0, 1].map(|k| n[0] * a[k] + n[1] * m[k] + n[2] * b[k]);
                let force = traction(point, normal).map(|t| t * weight * along[0].hypot(along[1]));
                for (node, n) in edge.iter().zip(n) {
                    forces[2 * *node as usize] += n * force[0];
                    forces[2 * *node as usize + 1] += n * force[1];
                }
            }
        }
        forces
    }

    /// Element edges (corner, midside, corner) on the rectangle, each with its outward normal.
    fn outer_edges(&self) -> Vec<([u32; 3], [f64; 2])> {
        let limits = [
            (0, self.outline.s[0], [-1.0, 0.0]),
            (0, self.outline.s[1], [1.0, 0.0]),
            (1, self.outline.t[0], [0.0, -1.0]),
            (1, self.outline.t[1], [0.0, 1.0]),
        ];
        let slack = 1e-9 * (self.outline.t[1] - self.outline.t[0]);
        let mut edges = Vec::new();
        for e in &self.elements {
            for k in 0..4 {
                let edge = [e[k], e[k + 4], e[(k + 1) % 4]];
                for (axis, limit, normal) in limits {
                    if edge
                        .iter()
                        .all(|&n| (self.nodes[n as usize][axis] - limit).abs() < slack)
                    {
                        edges.push((edge, normal));
                    }
                }
            }
        }
        edges
    }
}
