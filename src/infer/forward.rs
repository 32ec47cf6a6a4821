//! The field that a test would show: finite elements, optics, gauge and added fields, at any points.

use std::borrow::Cow;

use super::model::Model;
use crate::effect::{Acting, Kind, Scene, Seen};
use crate::error::{Error, Result};
use crate::experiment::{Gauge, ZeroAt, remove_rigid_motion_over, settle};
use crate::fem::{Locator, Mesh, Observer, Plate, Solution};

/// A predicted field at points (s, t).
pub struct View {
    /// Displacement (u1, u2), mm, with everything that acts but what the instrument records.
    pub field: Vec<[f64; 2]>,
    /// The part that is proportional to the load, under the model's gauge, mm.
    pub mechanical: Vec<[f64; 2]>,
    /// Gradient of the finite-element displacement, `g[i][k]` = d u_i / d x_k.
    pub gradient: Vec<[[f64; 2]; 2]>,
    /// `mechanical` and `gradient` at the outliers, for the gauge.
    pub outlying: (Vec<[f64; 2]>, Vec<[[f64; 2]; 2]>),
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
    /// Places of outliers, where nothing is predicted, but which a gauge over the measured points counts, mm.
    pub outlying: &'a [[f64; 2]],
    /// Their bounding box, low and high corner.
    pub window: [[f64; 2]; 2],
    /// Where the points lie on the plate's own mesh, if that is known.
    pub observer: Option<&'a Observer>,
}

/// Predict for elastic constants in border units and acting effects.
///
/// # Errors
/// Those of a finite-element solution; constants that are not admissible.
pub fn view(test: &Test<'_>, constants: &[f64], acting: &[Acting]) -> Result<View> {
    let Test {
        model,
        scene,
        plate,
        points,
        outlying,
        window,
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
        .material()
        .ply(constants)
        .admissible("elastic constants")?;
    let mut solution = plate.solve(&setup, &ply)?;
    match ZeroAt::new(model.experiment().gauge, &scene.frame, plate)? {
        Some(zero) => zero.apply(&mut solution),
        None => settle(&mut solution, window),
    }
    let Solution { mesh, nodal } = solution;
    let seen = Seen::new(acting, scene);
    let own = observer.filter(|_| matches!(mesh, Cow::Borrowed(_)) && seen.is_plain());
    let elsewhere = own.is_none().then(|| locate(points, &mesh, &seen));
    let Some(observer) = own.or(elsewhere.as_ref()) else {
        return Err(Error::program("forward::view", "points to look at"));
    };
    let reported = |observer: &Observer, points: &[[f64; 2]]| {
        let mut u = observer.displacement(&nodal);
        for (u, &p) in u.iter_mut().zip(points) {
            *u = seen.components(p, *u);
        }
        (u, observer.gradient(&nodal))
    };
    let (mut mechanical, gradient) = reported(observer, points);
    let (mut further, slope) = match outlying {
        [] => (Vec::new(), Vec::new()),
        _ => reported(&locate(outlying, &mesh, &seen), outlying),
    };
    if model.experiment().gauge == Gauge::Window {
        remove_rigid_motion_over(points, &mut mechanical, outlying, &mut further);
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
        outlying: (further, slope),
    })
}

/// Where the plate is that is reported at the points.
fn locate(points: &[[f64; 2]], mesh: &Mesh, seen: &Seen<'_>) -> Observer {
    let places: Vec<[f64; 2]> = points.iter().map(|&p| seen.true_point(p)).collect();
    Locator::new(mesh).observe_extended(&places)
}
