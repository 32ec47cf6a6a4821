//! The rigid motion of predicted fields: removed by least squares, or fixed at a point.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fem::{Locator, Mesh, Observer};
use crate::field::{Frame, rigid};

/// How the rigid motion of a predicted field is fixed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gauge {
    /// The least-squares translation and rotation over the measured points are removed.
    #[default]
    Window,
    /// The displacement and the local rotation vanish at this point of the data's frame, mm.
    ZeroAtMm([f64; 2]),
}

/// A point of the plate where displacement and local rotation are set to zero.
pub struct ZeroAt {
    point: [f64; 2],
    observer: Observer,
}

/// How far outside the plate a declared point may lie and still be its edge: the rounding of a file, mm.
const ON_EDGE_MM: f64 = 1e-6;

impl ZeroAt {
    /// The point of [`Gauge::ZeroAtMm`], nothing for [`Gauge::Window`].
    pub fn new(gauge: Gauge, frame: &Frame, mesh: &Mesh) -> Result<Option<Self>> {
        let Gauge::ZeroAtMm(place) = gauge else {
            return Ok(None);
        };
        let outline = mesh.outline;
        let [s, t] = frame.point(place);
        let point = [onto(s, outline.s), onto(t, outline.t)];
        let (observer, inside) = Locator::new(mesh).observe(&[point]);
        if inside[0] {
            return Ok(Some(Self { point, observer }));
        }
        Err(Error::input("gauge.zero_at_mm", "a point of the plate, in the data's frame")
            .found(format!("{place:?}"))
            .hint(format!(
                "the plate spans {:?} mm along the load and {:?} mm across it, measured from the hole's centre, which lies at {:?} mm in the data",
                outline.s, outline.t, frame.hole_center_mm
            )))
    }

    /// Subtract from nodal displacements the rigid motion that makes the point stand still.
    pub fn apply(&self, mesh: &Mesh, u: &mut [f64]) {
        let g = self.observer.gradient(u)[0];
        let motion = rigid::RigidMotion {
            shift: self.observer.displacement(u)[0],
            angle: 0.5 * (g[1][0] - g[0][1]),
            center: self.point,
        };
        subtract(mesh, &motion, u);
    }
}

fn onto(value: f64, [low, high]: [f64; 2]) -> f64 {
    let nearest = value.clamp(low, high);
    if (nearest - value).abs() < ON_EDGE_MM {
        nearest
    } else {
        value
    }
}

/// Subtract the least-squares rigid motion over some nodes. It keeps snapshots small; the exact gauge, over the
/// measured points, follows when the modes are evaluated there.
pub fn remove_rigid_motion_of_nodes(mesh: &Mesh, nodes: &[u32], u: &mut [f64]) {
    let places: Vec<_> = nodes.iter().map(|&n| mesh.nodes[n as usize]).collect();
    let values: Vec<_> = nodes
        .iter()
        .map(|&n| [u[2 * n as usize], u[2 * n as usize + 1]])
        .collect();
    subtract(mesh, &rigid::fit(&places, &values), u);
}

fn subtract(mesh: &Mesh, motion: &rigid::RigidMotion, u: &mut [f64]) {
    for (node, &p) in mesh.nodes.iter().enumerate() {
        let [u1, u2] = motion.at(p);
        u[2 * node] -= u1;
        u[2 * node + 1] -= u2;
    }
}

/// Remove from a field its least-squares rigid motion over the points.
pub fn remove_rigid_motion(points: &[[f64; 2]], field: &mut [[f64; 2]]) {
    let motion = rigid::fit(points, field);
    for (&p, u) in points.iter().zip(field) {
        let [u1, u2] = motion.at(p);
        u[0] -= u1;
        u[1] -= u2;
    }
}
