//! How far an imported mesh is from a finer one.

use crate::error::Result;
use crate::fem::{Locator, Plate, Setup};
use crate::field::rigid;
use crate::geometry::Density;
use crate::laminate::Ply;

/// What halving all elements changes over a window, without rigid motion.
#[derive(Debug, Clone, Copy)]
pub struct MeshError {
    /// Root mean square of both components, mm.
    pub rms_mm: f64,
    /// The largest change, mm, and where it is, (s, t) mm.
    pub largest_mm: f64,
    pub place: [f64; 2],
}

/// Points along each side of the window.
const SIDE: usize = 60;

/// Solve a test on the mesh of a plate and on one of half its elements' size; none where the geometry makes its own mesh.
///
/// # Errors
/// Those of [`Plate::solve`].
pub(super) fn mesh_error(
    plate: &Plate,
    (setup, ply): &(Setup, Ply),
    (window, density): ([[f64; 2]; 2], Density),
) -> Result<Option<MeshError>> {
    if plate.geometry.name() != "imported" {
        return Ok(None);
    }
    let finer = Plate::new(setup, Density(density.0.max(1.0)).scaled(2.0))?;
    let [low, high] = window;
    let at = |k: usize, i: usize| low[k] + (high[k] - low[k]) * (i as f64 + 0.5) / SIDE as f64;
    let lattice = (0..SIDE * SIDE).map(|i| [at(0, i / SIDE), at(1, i % SIDE)]);
    let lattice: Vec<[f64; 2]> = lattice.collect();
    let [here, there] = [plate, &finer].map(|plate| plate.solve_full_order(setup, ply));
    let (here, there) = (here?, there?);
    let locators = [Locator::new(&here.mesh), Locator::new(&there.mesh)];
    let [on_here, on_there] = locators.each_ref().map(|l| l.holds(&lattice));
    let both = lattice.iter().zip(on_here.iter().zip(&on_there));
    let points: Vec<[f64; 2]> = both
        .filter(|(_, (a, b))| **a && **b)
        .map(|(p, _)| *p)
        .collect();
    let seen =
        |locator: &Locator<'_>, nodal: &[f64]| locator.observe(&points).0.displacement(nodal);
    let (coarse, fine) = (
        seen(&locators[0], &here.nodal),
        seen(&locators[1], &there.nodal),
    );
    let pairs = coarse.iter().zip(&fine);
    let change: Vec<[f64; 2]> = pairs.map(|(a, b)| [b[0] - a[0], b[1] - a[1]]).collect();
    let motion = rigid::fit(&points, &change);
    let left = points.iter().zip(&change).map(|(&p, u)| {
        let m = motion.at(p);
        ((u[0] - m[0]).hypot(u[1] - m[1]), p)
    });
    let left: Vec<(f64, [f64; 2])> = left.collect();
    let square: f64 = left.iter().map(|(d, _)| d * d).sum();
    let worst = left
        .iter()
        .fold((0.0, [0.0; 2]), |w, x| if x.0 > w.0 { *x } else { w });
    Ok(Some(MeshError {
        rms_mm: (square / (2 * left.len()).max(1) as f64).sqrt(),
        largest_mm: worst.0,
        place: worst.1,
    }))
}
