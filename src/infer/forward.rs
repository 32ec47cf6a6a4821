//! The field that a test would show: finite elements, optics, gauge and added fields, at any points.

use super::model::Model;
use crate::effect::{Acting, Kind, Scene};
use crate::error::Result;
use crate::fem::{Forward, Locator, Plate};
use crate::reduce::{Gauge, ZeroAt, remove_rigid_motion};

/// A predicted field at points (s, t).
pub struct View {
    /// Displacement (u1, u2), mm, with everything that acts but what the instrument records.
    pub field: Vec<[f64; 2]>,
    /// The part that is proportional to the load, under the model's gauge, mm.
    pub mechanical: Vec<[f64; 2]>,
    /// Gradient of the finite-element displacement, `g[i][k]` = d u_i / d x_k.
    pub gradient: Vec<[[f64; 2]; 2]>,
}

/// Predict at `points` for elastic constants in border units and acting effects, on a plate whose outline is the model's.
///
/// # Errors
/// Those of a finite-element solution; constants that are not admissible.
pub fn view(
    scene: &Scene,
    model: &Model,
    plate: &Plate,
    points: &[[f64; 2]],
    constants: &[f64],
    acting: &[Acting],
) -> Result<View> {
    let mut setup = scene.setup.clone();
    for a in acting
        .iter()
        .filter(|a| a.effect.kind() == Kind::Mechanical)
    {
        a.effect.alter(&a.amplitude, &mut setup);
    }
    let ply = model
        .file
        .specimen
        .material
        .ply(constants)
        .admissible("elastic constants")?;
    let mut nodal = plate.displacement(&setup, &ply)?;
    if let Some(zero) = ZeroAt::new(model.file.gauge, &scene.frame, plate)? {
        zero.apply(&plate.mesh, &mut nodal);
    }
    let (observer, _) = Locator::new(&plate.mesh).observe(points);
    let mut mechanical = observer.displacement(&nodal);
    let gradient = observer.gradient(&nodal);
    if model.file.gauge == Gauge::Window {
        remove_rigid_motion(points, &mut mechanical);
    }
    let mut field = mechanical.clone();
    for a in acting.iter().filter(|a| a.effect.kind() == Kind::Additive) {
        for (u, &p) in field.iter_mut().zip(points) {
            let added = a.effect.displacement(&a.amplitude, scene, p);
            u[0] += added[0];
            u[1] += added[1];
        }
    }
    Ok(View {
        field,
        mechanical,
        gradient,
    })
}
