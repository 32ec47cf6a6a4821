//! The rigid motion of predicted fields: removed by least squares, or fixed at a point.

use serde::{Deserialize, Serialize};

use super::PointSet;
use crate::error::{Error, Result};
use crate::fem::{Locator, Motion, Observer, Plate, Solution};
use crate::field::{Frame, rigid};
use crate::geometry::{Geometry, HOLE, Mesh};

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
    nominal: [[f64; 2]; 2],
    observer: Observer,
}

/// How far outside the plate a declared point may lie and still be its edge: the rounding of a file, mm.
const ON_EDGE_MM: f64 = 1e-6;

impl ZeroAt {
    /// The point of [`Gauge::ZeroAtMm`], nothing for [`Gauge::Window`].
    pub fn new(gauge: Gauge, frame: &Frame, plate: &Plate) -> Result<Option<Self>> {
        let Gauge::ZeroAtMm(place) = gauge else {
            return Ok(None);
        };
        let extents = plate.mesh.extents;
        let point = onto(frame.point(place), extents, extents);
        let (observer, inside) = Locator::new(&plate.mesh).observe(&[point]);
        if inside[0] {
            return Ok(Some(Self {
                point,
                nominal: extents,
                observer,
            }));
        }
        Err(refused(place, frame, &*plate.geometry))
    }

    /// Subtract from a solution the rigid motion that makes the point stand still. A point on an edge or an end stays
    /// there where an effect has moved it; any other point keeps its coordinates.
    pub fn apply(&self, solution: &mut Solution<'_>) {
        let nominal = solution.is_nominal();
        let Solution { mesh, nodal } = solution;
        if nominal {
            let motion = still(&self.observer, self.point, nodal);
            return subtract(mesh, &motion, nodal);
        }
        let (observer, point) = self.on(mesh);
        let motion = still(&observer, point, nodal);
        subtract(mesh, &motion, nodal);
    }

    /// The point on a mesh of another shape.
    fn on(&self, mesh: &Mesh) -> (Observer, [f64; 2]) {
        let point = onto(self.point, self.nominal, mesh.extents);
        (Locator::new(mesh).observe_extended(&[point]), point)
    }

    /// The motion that is subtracted from fields on a mesh, part by part, at a sight's points.
    pub fn motions(&self, mesh: &Mesh, sight: &PointSet) -> Vec<Motion> {
        let (observer, point) = self.on(mesh);
        let n = mesh.unknowns();
        let shifts = [[1.0, 0.0], [0.0, 1.0]].map(|unit| observer.forces(&[unit], n));
        let [first, second] = shifts;
        parts([first, second, observer.couple(n)], sight, point)
    }
}

/// The motion that [`Gauge::Window`] takes from fields on a mesh, part by part, at a sight's points, which the observer knows.
pub(super) fn window_motions(mesh: &Mesh, observer: &Observer, sight: &PointSet) -> Vec<Motion> {
    let points = sight.all();
    let n = points.len().max(1) as f64;
    let center = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let about = |p: &[f64; 2]| [p[0] - center[0], p[1] - center[1]];
    let inertia: f64 = points.iter().map(about).map(|[s, t]| s * s + t * t).sum();
    let inertia = if inertia > 0.0 {
        inertia
    } else {
        f64::INFINITY
    };
    let turn = |p: &[f64; 2]| {
        let [s, t] = about(p);
        [-t / inertia, s / inertia]
    };
    let weights = [
        vec![[1.0 / n, 0.0]; points.len()],
        vec![[0.0, 1.0 / n]; points.len()],
        points.iter().map(turn).collect(),
    ];
    let forces = weights.map(|w| observer.forces(&w, mesh.unknowns()));
    parts(forces, sight, center)
}

/// Both shifts and the rotation about a point, with the forces that find how much of each a field has.
fn parts(forces: [Vec<f64>; 3], sight: &PointSet, center: [f64; 2]) -> Vec<Motion> {
    let unit = |k: usize| rigid::RigidMotion {
        shift: [0, 1].map(|i| if i == k { 1.0 } else { 0.0 }),
        angle: if k == 2 { 1.0 } else { 0.0 },
        own: 0.0,
        center,
    };
    let part = |(k, forces): (usize, Vec<f64>)| Motion {
        forces,
        at: sight.all().iter().map(|&p| unit(k).at(p)).collect(),
    };
    forces.into_iter().enumerate().map(part).collect()
}

/// Refuse a point of [`Gauge::ZeroAtMm`] that is none of the plate, before anything is solved. Beside a clamp, where the
/// plate may be wider, only a mesh knows.
///
/// # Errors
/// The input's fault, at `gauge.zero_at_mm`.
pub fn check(gauge: Gauge, frame: &Frame, geometry: &dyn Geometry) -> Result<()> {
    let Gauge::ZeroAtMm(place) = gauge else {
        return Ok(());
    };
    let [s, t] = frame.point(place);
    let extents = geometry.extents();
    let along = |[low, high]: [f64; 2], x: f64| (low - ON_EDGE_MM..=high + ON_EDGE_MM).contains(&x);
    let beyond = !along(extents[0], s) || (geometry.widening() == 1.0 && !along(extents[1], t));
    let in_hole = geometry
        .distance(HOLE, [s, t])
        .is_some_and(|d| d < -ON_EDGE_MM);
    if beyond || in_hole {
        return Err(refused(place, frame, geometry));
    }
    Ok(())
}

fn refused(place: [f64; 2], frame: &Frame, geometry: &dyn Geometry) -> Error {
    let where_it_lies = match geometry.distance(HOLE, frame.point(place)) {
        Some(d) if d < 0.0 => format!("in the hole, {:.3} mm from its edge", -d),
        _ => "beyond the plate's edges".into(),
    };
    let [s, t] = geometry.extents();
    Error::input("gauge.zero_at_mm", "a point of the plate, in the data's frame")
        .found(format!("{place:?}, which lies {where_it_lies}"))
        .hint(format!(
            "the plate spans {s:?} mm along the load and {t:?} mm across it, measured from the hole's centre (the plate's without a hole), which lies at {:?} mm in the data",
            frame.hole_center_mm
        ))
}

fn still(observer: &Observer, point: [f64; 2], nodal: &[f64]) -> rigid::RigidMotion {
    let g = observer.gradient(nodal)[0];
    rigid::RigidMotion {
        shift: observer.displacement(nodal)[0],
        angle: 0.5 * (g[1][0] - g[0][1]),
        own: 0.0,
        center: point,
    }
}

/// A point, moved with the ends and sides `from` that it lies on to where they lie in `to`.
fn onto(point: [f64; 2], from: [[f64; 2]; 2], to: [[f64; 2]; 2]) -> [f64; 2] {
    [0, 1].map(|k| {
        let mut limits = from[k].into_iter().zip(to[k]);
        let at = limits.find(|(from, _)| (from - point[k]).abs() < ON_EDGE_MM);
        at.map_or(point[k], |(_, to)| to)
    })
}

/// Steps of the grid over a window on which a solution's rigid motion is fitted.
const STEPS: u32 = 40;

/// Subtract from a solution its least-squares rigid motion over a window, low and high corner (s, t) in mm. Optics see the
/// specimen so: what a lens makes of a rotation depends on the rotation.
pub(super) fn hold_window(solution: &mut Solution<'_>, [low, high]: [[f64; 2]; 2]) {
    let step = |k: usize, i: u32| low[k] + (high[k] - low[k]) * f64::from(i) / f64::from(STEPS);
    let points: Vec<[f64; 2]> = (0..=STEPS)
        .flat_map(|i| (0..=STEPS).map(move |j| [step(0, i), step(1, j)]))
        .collect();
    let (observer, inside) = Locator::new(&solution.mesh).observe(&points);
    let kept = points.into_iter().zip(inside).filter(|(_, inside)| *inside);
    let places: Vec<_> = kept.map(|(p, _)| p).collect();
    let motion = rigid::fit(&places, &observer.displacement(&solution.nodal));
    subtract(&solution.mesh, &motion, &mut solution.nodal);
}

fn subtract(mesh: &Mesh, motion: &rigid::RigidMotion, u: &mut [f64]) {
    for (node, &p) in mesh.nodes.iter().enumerate() {
        let [u1, u2] = motion.at(p);
        u[2 * node] -= u1;
        u[2 * node + 1] -= u2;
    }
}

/// A field under the gauge, at a sight's points, from its values at all of them, further ones included: the projection that
/// data, modes and sensitivities have in common. Under [`Gauge::Window`] it is free of the least-squares rigid motion over
/// all of them; under [`Gauge::ZeroAtMm`] the specimen was held before it was looked at.
pub fn gauged(gauge: Gauge, sight: &PointSet, all: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let points = sight.points();
    if gauge != Gauge::Window {
        return all[..points.len()].to_vec();
    }
    rigid::fit(sight.all(), all).removed(points, all)
}
