//! Tractions on named edges and the load vectors they give.

use super::element::GAUSS;
use crate::geometry::{HIGH, LOW, Mesh};

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
}

impl EndLoad {
    /// The same load times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            axial: factor * self.axial,
            shear: factor * self.shear,
            moment: factor * self.moment,
        }
    }
}

impl Mesh {
    /// Consistent nodal forces (N, two an entry of `nodes`) of the end tractions.
    pub fn end_forces(&self, load: &EndLoad) -> Vec<f64> {
        let [[s0, s1], [t0, t1]] = self.extents;
        let width = t1 - t0;
        let (center_t, half) = (0.5 * (t0 + t1), 0.5 * (s1 - s0));
        self.edge_forces(&[HIGH, LOW], &|[_, t], [outward, _]| {
            let t = t - center_t;
            let moment = load.moment + load.shear * outward * half;
            let normal = load.axial / width + 12.0 * moment * t / width.powi(3);
            let tangent = 1.5 * load.shear / width * (1.0 - (2.0 * t / width).powi(2));
            [outward * normal, outward * tangent]
        })
    }

    /// Consistent nodal forces (N, two an entry of `nodes`) of a traction on named edges: `traction(point, outward unit
    /// normal)` in N/mm. Exact for straight edges: 3-point Gauss integrates a quadratic traction times a quadratic shape
    /// function.
    pub fn edge_forces(
        &self,
        names: &[&str],
        traction: &dyn Fn([f64; 2], [f64; 2]) -> [f64; 2],
    ) -> Vec<f64> {
        let mut forces = vec![0.0; self.unknowns()];
        for edge in names.iter().flat_map(|name| self.edge(name)) {
            let [a, m, b] = edge.map(|n| self.nodes[n as usize]);
            for (x, weight) in GAUSS {
                let n = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
                let along = [0, 1].map(|k| (x - 0.5) * a[k] - 2.0 * x * m[k] + (x + 0.5) * b[k]);
                let point = [0, 1].map(|k| n[0] * a[k] + n[1] * m[k] + n[2] * b[k]);
                let length = along[0].hypot(along[1]);
                let normal = [along[1] / length, -along[0] / length];
                let force = traction(point, normal).map(|t| t * weight * length);
                for (node, n) in edge.iter().zip(n) {
                    forces[2 * *node as usize] += n * force[0];
                    forces[2 * *node as usize + 1] += n * force[1];
                }
            }
        }
        forces
    }
}
