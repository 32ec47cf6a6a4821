//! What the camera sees of a specimen that bends out of its plane.

use nalgebra::{Matrix3, Vector3};

use super::PointSet;
use crate::effect::Scene;
use crate::error::Result;
use crate::fem::{EndMoment, Locator, Observer, bend, plain_deflection, plain_rotation};
use crate::geometry::Mesh;
use crate::laminate::PlateStiffness;

/// The nominal specimen bent by moments at its ends such that the curvature along the load, far from the hole, is 1/mm, and bent such
/// that it grows along the load by 1/mm^2 from zero at the origin. A field is a combination of the two.
pub struct Bending {
    /// Nodal displacements of the face that is seen, z = +h/2, mm, two a node.
    face: [Vec<f64>; 2],
    /// Nodal deflections towards the camera in the two cases, mm, interleaved, without the plane that fits them best over the window: an
    /// effect of its own holds how the specimen moves and turns out of its plane.
    deflection: Vec<f64>,
    /// The middle of the window, (s, t) mm, about which the camera looks.
    centre: [f64; 2],
    camera_distance_mm: Option<f64>,
}

/// Cells along each side of the window at whose middles rigid motion is fitted.
const CELLS: u32 = 40;

impl Bending {
    /// Solve the uniform case for a scene's specimen, its constants and layup nominal, on its mesh; `window` has its low and high corner,
    /// (s, t) mm. The part that grows along the load is that of a plate without a hole: what moments and shear at the ends, between which
    /// it would be solved, depends on how the ends are held, and it is nothing at the hole itself. In-plane motion of the face is that of a plate without a hole about the origin: what the hole changes has no mean
    /// over the window.
    ///
    /// # Errors
    /// Those of [`bend`].
    pub fn new(scene: &Scene, mesh: &Mesh, window: [[f64; 2]; 2]) -> Result<Self> {
        let setup = &scene.setup;
        let plate = PlateStiffness::of(&scene.ply, &setup.angles, setup.thickness);
        let uniform = EndMoment::bending(&plate, [1.0, 0.0]);
        let bent = bend(mesh, &plate, &[uniform])?;
        let points = grid(window);
        let (observer, inside) = Locator::new(mesh).observe(&points);
        let kept = points.into_iter().zip(inside).filter(|(_, inside)| *inside);
        let points: Vec<[f64; 2]> = kept.map(|(p, _)| p).collect();
        let half = 0.5 * setup.thickness;
        let middle = middle(setup.geometry.extents()[1]);
        let growing = |[s, t]: [f64; 2]| plain_deflection(&plate, [s, t - middle]);
        let nodes = bent[0].deflection.iter().zip(&mesh.nodes);
        let mut deflection: Vec<f64> = nodes.flat_map(|(w, &p)| [*w, growing(p)]).collect();
        level(mesh, (&points, &observer), &mut deflection);
        let plain = |curvature: [f64; 2], [s, t]: [f64; 2]| {
            let [at, origin] =
                [[s, t - middle], [0.0, -middle]].map(|p| plain_rotation(&plate, curvature, p));
            [at[0] - origin[0], at[1] - origin[1]]
        };
        let mut shift = [0.0; 2];
        for (&p, found) in points.iter().zip(observer.displacement(&bent[0].rotation)) {
            let wanted = plain([1.0, 0.0], p);
            for c in 0..2 {
                shift[c] += (wanted[c] - found[c]) / points.len() as f64;
            }
        }
        let moved = |r: &[f64]| [half * (r[0] + shift[0]), half * (r[1] + shift[1])];
        let of_gradient = |&p: &[f64; 2]| plain([0.0, 1.0], p).map(|r| half * r);
        Ok(Self {
            face: [
                bent[0].rotation.chunks(2).flat_map(moved).collect(),
                mesh.nodes.iter().flat_map(of_gradient).collect(),
            ],
            deflection,
            centre: [0, 1].map(|k| 0.5 * (window[0][k] + window[1][k])),
            camera_distance_mm: scene.camera_distance_mm,
        })
    }

    /// The displacement (mm) that is reported at a sight's points, which `observer` has located on the mesh, for a curvature along the
    /// load of `[0]` + `[1]` s (1/mm, 1/mm^2): that of the face, and the perspective of the deflection w, (X - c) w / Z to first order in
    /// w over the camera's distance Z.
    pub fn shown(
        &self,
        curvature: [f64; 2],
        observer: &Observer,
        sight: &PointSet,
    ) -> Vec<[f64; 2]> {
        let nodal = |k: usize| self.face[0][k] * curvature[0] + self.face[1][k] * curvature[1];
        let face: Vec<f64> = (0..self.face[0].len()).map(nodal).collect();
        let mut shown = observer.displacement(&face);
        if let Some(distance) = self.camera_distance_mm {
            let deflection = observer.displacement(&self.deflection);
            for ((u, w), p) in shown.iter_mut().zip(deflection).zip(sight.all()) {
                let w = w[0] * curvature[0] + w[1] * curvature[1];
                for c in 0..2 {
                    u[c] += (p[c] - self.centre[c]) * w / distance;
                }
            }
        }
        shown.truncate(sight.points().len());
        shown
    }

    /// What that perspective is less, mm a mm, where the camera looks about a place farther along either direction: w / Z; nothing without a
    /// camera's distance.
    pub fn off_axis(&self, curvature: [f64; 2], observer: &Observer) -> Vec<f64> {
        let distance = self.camera_distance_mm.unwrap_or(f64::INFINITY);
        let deflection = observer.displacement(&self.deflection).into_iter();
        deflection
            .map(|w| -(w[0] * curvature[0] + w[1] * curvature[1]) / distance)
            .collect()
    }
}

/// The middle of an interval.
fn middle([low, high]: [f64; 2]) -> f64 {
    0.5 * (low + high)
}

/// Points over a window.
fn grid([low, high]: [[f64; 2]; 2]) -> Vec<[f64; 2]> {
    let share = |i: u32| (f64::from(i) + 0.5) / f64::from(CELLS);
    let at = |k: usize, i: u32| low[k] + (high[k] - low[k]) * share(i);
    (0..CELLS)
        .flat_map(|i| (0..CELLS).map(move |j| [at(0, i), at(1, j)]))
        .collect()
}

/// Subtract from two interleaved nodal fields the planes that fit them best at observed points.
fn level(mesh: &Mesh, (points, observer): (&[[f64; 2]], &Observer), nodal: &mut [f64]) {
    let mut gram = Matrix3::zeros();
    let mut right = [Vector3::zeros(); 2];
    for (&[s, t], value) in points.iter().zip(observer.displacement(nodal)) {
        let row = Vector3::new(1.0, s, t);
        gram += row * row.transpose();
        for (right, value) in right.iter_mut().zip(value) {
            *right += row * value;
        }
    }
    // points on one line determine no plane; nothing is seen of a deflection there
    let Some(gram) = gram.cholesky() else {
        return;
    };
    let planes = right.map(|right| gram.solve(&right));
    for (&[s, t], values) in mesh.nodes.iter().zip(nodal.chunks_mut(2)) {
        for (value, plane) in values.iter_mut().zip(&planes) {
            *value -= plane.dot(&Vector3::new(1.0, s, t));
        }
    }
}
