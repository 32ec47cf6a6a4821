//! Verification of the finite elements by refinement.

use plychain::error::{Error, Result};
use plychain::fem::{Locator, Plate, Setup};
use plychain::field::rigid;
use plychain::geometry::{Density, Geometry};
use plychain::laminate::Ply;

/// One line of a verification table.
#[derive(Debug)]
pub struct Check {
    /// What was computed.
    pub what: String,
    /// The figure.
    pub value: f64,
    /// What it may be at most.
    pub bound: f64,
    /// Whether it holds.
    pub passed: bool,
}

impl Check {
    pub fn new(what: impl Into<String>, value: f64, bound: f64) -> Self {
        Self {
            what: what.into(),
            value,
            bound,
            passed: value <= bound,
        }
    }
}

/// Largest difference of the displacements in the window (half side `half`, mm, up to the hole's edge, rigid
/// motion removed) between a mesh and the one with all counts doubled, over the largest displacement.
///
/// # Errors
/// A set-up that cannot be meshed or solved.
pub fn window_convergence(setup: &Setup, ply: &Ply, density: Density, half: f64) -> Result<Check> {
    let points = window_points(&*setup.geometry, half);
    let coarse = observe(&Plate::new(setup, density)?, setup, ply, &points)?;
    let fine = Plate::new(setup, density.scaled(2.0))?;
    let fine = observe(&fine, setup, ply, &points)?;
    Ok(Check::new(
        "window displacement change under one refinement, relative",
        difference(&points, &coarse, &fine),
        1e-5,
    ))
}

/// Largest difference of two fields over the amplitude of the second, both without their rigid motion.
pub fn difference(points: &[[f64; 2]], u: &[[f64; 2]], v: &[[f64; 2]]) -> f64 {
    let (u, v) = (
        without_rigid_motion(points, u),
        without_rigid_motion(points, v),
    );
    let amplitude = v.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    let pairs = u.iter().flatten().zip(v.iter().flatten());
    pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

/// A field minus its least-squares rigid motion.
pub fn without_rigid_motion(points: &[[f64; 2]], u: &[[f64; 2]]) -> Vec<[f64; 2]> {
    rigid::fit(points, u).removed(points, u)
}

/// A grid over the window and rings about the hole, from its very edge.
pub fn window_points(geometry: &dyn Geometry, half: f64) -> Vec<[f64; 2]> {
    let extents = geometry.extents();
    let step = |k: i32| half * f64::from(k) / 40.0;
    let grid = (-40..=40).flat_map(|i| (-40..=40).map(move |j| [step(i), step(j)]));
    let around = |radius: f64| {
        [1.0, 1.005, 1.02, 1.04, 1.1, 1.2, 1.4]
            .into_iter()
            .flat_map(move |f| {
                (0..720).map(move |k| {
                    let (sin, cos) = (0.5 * f64::from(k) + 0.15).to_radians().sin_cos();
                    [f * radius * cos, f * radius * sin]
                })
            })
    };
    let rings = geometry.hole_radius().into_iter().flat_map(around);
    let inside = |p: &[f64; 2]| {
        (0..2).all(|k| p[k].abs() <= half && p[k] >= extents[k][0] && p[k] <= extents[k][1])
            && geometry
                .hole_radii(*p)
                .is_none_or(|radii| radii >= 1.0 - 1e-12)
    };
    grid.chain(rings).filter(inside).collect()
}

/// Displacements of a set-up at points of its plate.
///
/// # Errors
/// Of the program: points outside.
pub fn observe(
    plate: &Plate,
    setup: &Setup,
    ply: &Ply,
    points: &[[f64; 2]],
) -> Result<Vec<[f64; 2]>> {
    let nodal = plate.solve(setup, ply)?.nodal;
    let (observer, inside) = Locator::new(&plate.mesh).observe(points);
    if inside.contains(&false) {
        return Err(Error::program(
            "verification points",
            "points inside the mesh",
        ));
    }
    Ok(observer.displacement(&nodal))
}
