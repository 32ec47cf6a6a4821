//! The field that a test would show: finite elements, optics, gauge and added fields, at any points.

use std::borrow::Cow;

use super::model::Model;
use crate::effect::{Acting, Kind, Scene};
use crate::error::{Error, Result};
use crate::fem::{Factor, Locator, Observer, Plate, Solution};
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

/// The test whose field is predicted.
pub struct Test<'a> {
    /// The model.
    pub model: &'a Model,
    /// What effects need to know of it.
    pub scene: &'a Scene,
    /// A plate of the model's outline.
    pub plate: &'a Plate,
    /// Points (s, t) as they are reported, mm.
    pub points: &'a [[f64; 2]],
    /// Where the points lie on the plate's own mesh, if that is known.
    pub observer: Option<&'a Observer>,
}

/// Predict for elastic constants in border units and acting effects, in the work space of the plate.
///
/// # Errors
/// Those of a finite-element solution; constants that are not admissible.
pub fn view(
    test: &Test<'_>,
    factor: &mut Factor<'_>,
    constants: &[f64],
    acting: &[Acting],
) -> Result<View> {
    let Test {
        model,
        scene,
        plate,
        points,
        observer,
    } = *test;
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
    let Solution { mesh, mut nodal } = plate.solve(&setup, &ply, factor)?;
    if let Some(zero) = ZeroAt::new(model.file.gauge, &scene.frame, &mesh)? {
        zero.apply(&mesh, &mut nodal);
    }
    let optics: Vec<&Acting> = acting
        .iter()
        .filter(|a| a.effect.kind() == Kind::Optical)
        .collect();
    let own = observer.filter(|_| matches!(mesh, Cow::Borrowed(_)) && optics.is_empty());
    let elsewhere = own.is_none().then(|| {
        let seen: Vec<[f64; 2]> = points
            .iter()
            .map(|&p| true_point(&optics, scene, p))
            .collect();
        Locator::new(&mesh).observe_extended(&seen)
    });
    let Some(observer) = own.or(elsewhere.as_ref()) else {
        return Err(Error::program("forward::view", "points to look at"));
    };
    let mut mechanical = observer.displacement(&nodal);
    for (u, &p) in mechanical.iter_mut().zip(points) {
        for a in &optics {
            *u = a.effect.components(&a.amplitude, scene, p, *u);
        }
    }
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

/// Which reported points show the plate itself, not the hole or what lies beyond the edges.
pub fn visible(scene: &Scene, plate: &Plate, points: &[[f64; 2]], acting: &[Acting]) -> Vec<bool> {
    let optics: Vec<&Acting> = acting
        .iter()
        .filter(|a| a.effect.kind() == Kind::Optical)
        .collect();
    let seen: Vec<[f64; 2]> = points
        .iter()
        .map(|&p| true_point(&optics, scene, p))
        .collect();
    Locator::new(&plate.mesh).observe(&seen).1
}

/// The true point that is reported as `reported` when several optical effects act, in the order of the dictionary.
fn true_point(optics: &[&Acting], scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
    optics
        .iter()
        .rev()
        .fold(reported, |p, a| a.effect.true_point(&a.amplitude, scene, p))
}
