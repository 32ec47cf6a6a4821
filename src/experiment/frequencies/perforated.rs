//! A plate with its circular hole: by how much the hole moves each frequency, from finite elements of the plate with the hole and with next to
//! none. The layers at free edges, which only the plate's own functions resolve, are in both alike and drop out.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::basis::PlateEdge;
use super::plate::{VibratingPlate, Weight};
use super::ritz::{Ritz, VibrationMode};
use super::theory::{PlateSupports, Theory};
use crate::error::{Error, Result};
use crate::fem::Vibrating;
use crate::fem::plate_element::PER_NODE;
use crate::geometry::{Density, Geometry, Mesh, Morph, Outline, StripWithHole};
use crate::laminate::HoleSpec;

/// The hole beside which the other one is compared, by its radius.
const NEXT_TO_NONE: f64 = 0.05;

/// Largest hole by the smaller side: what the constants do to a mode's frequency is taken as without the hole.
pub const LARGEST: f64 = 0.35;

/// Of the default mesh; twice as dense changes a factor by less than 1e-4.
const DENSITY: Density = Density(0.5);

/// Modes beyond those that are asked for.
const GUARD: usize = 6;

/// Lambda of a plate with a hole over that without, for each of some modes of the plate without.
///
/// # Errors
/// The input's fault: a hole that is no hole of this plate, or too large; those of the finite elements.
pub fn factors(
    plate: &VibratingPlate,
    hole: &HoleSpec,
    supports: &PlateSupports,
    (ritz, modes): (&Ritz, &[VibrationMode]),
) -> Result<Vec<f64>> {
    let Some(first) = modes.first() else {
        return Ok(Vec::new());
    };
    let sides = [plate.length, plate.width];
    if hole.diameter_mm > LARGEST * sides[0].min(sides[1]) {
        return Err(Error::input(
            "specimen.hole.diameter_mm",
            format!("at most {LARGEST} of the plate's smaller side"),
        )
        .found(hole.diameter_mm));
    }
    let center = hole.center_mm;
    let strip = StripWithHole {
        outline: Outline {
            s: [-0.5, 0.5].map(|h| h * sides[0] - center[0]),
            t: [-0.5, 0.5].map(|h| h * sides[1] - center[1]),
            clamp: None,
        },
        radius: 0.5 * hole.diameter_mm,
    };
    strip.validate()?;
    let counts = strip.counts(DENSITY);
    let small = strip.morphed(&Morph {
        hole_size: NEXT_TO_NONE,
        ..Morph::NONE
    })?;
    let [bare, holed] = [small.mesh(&counts), strip.mesh(&counts)];
    let pinned = pinned(&bare, supports);
    let vibrating = |mesh| Vibrating {
        mesh,
        plate: plate.stiffness(),
        mass_per_area: plate.mass_per_area(),
        thickness: plate.thickness,
        pinned: &pinned,
    };
    let start = start(&bare, (ritz, modes), supports, (sides, center));
    let wanted = start.ncols();
    let shift = 0.1 * first.lambda;
    let without = vibrating(&bare).modes(&start, shift, wanted - GUARD)?;
    let with = vibrating(&holed).modes(&without.shapes, shift, wanted - GUARD)?;
    let named = partners(&without.images.tr_mul(&start), modes.len());
    let same = partners(&with.images.tr_mul(&without.shapes), wanted);
    let area = PI * strip.radius * strip.radius / (sides[0] * sides[1]);
    // what was weighed lacks the hole, what has a density does not
    let weighed = match plate.weight {
        Weight::Mass(_) => 1.0 - area,
        Weight::Density(_) => 1.0,
    };
    let factor = |k: usize| weighed * with.lambda[same[named[k]]] / without.lambda[named[k]];
    Ok((0..modes.len()).map(factor).collect())
}

/// Unknowns that supports hold.
fn pinned(mesh: &Mesh, supports: &PlateSupports) -> Vec<usize> {
    let mut pinned = Vec::new();
    for (node, point) in mesh.nodes.iter().enumerate() {
        for (axis, edges) in [supports.x, supports.y].iter().enumerate() {
            let [low, high] = mesh.extents[axis];
            let near = |end: f64| (point[axis] - end).abs() < 1e-9 * (high - low);
            let edge = match () {
                () if near(low) => edges[0],
                () if near(high) => edges[1],
                () => PlateEdge::Free,
            };
            // the rotation about a simply supported edge is free, the one along it is not
            let held: &[usize] = match edge {
                PlateEdge::Free => &[],
                PlateEdge::SimplySupported => &[0, 2 - axis],
                PlateEdge::Clamped => &[0, 1, 2],
            };
            pinned.extend(held.iter().map(|c| PER_NODE * node + c));
        }
    }
    pinned.sort_unstable();
    pinned.dedup();
    pinned
}

/// Deflections of the modes at a mesh's nodes, then of rigid motions, then of some waves for a guard; rotations follow with the first solution.
fn start(
    mesh: &Mesh,
    (ritz, modes): (&Ritz, &[VibrationMode]),
    supports: &PlateSupports,
    (sides, center): ([f64; 2], [f64; 2]),
) -> DMatrix<f64> {
    let share = |p: &[f64; 2]| [0, 1].map(|k| (p[k] + center[k]) / sides[k] + 0.5);
    let points: Vec<[f64; 2]> = mesh.nodes.iter().map(share).collect();
    let mut columns: Vec<Vec<f64>> = modes.iter().map(|m| ritz.deflection(m, &points)).collect();
    let at = |r: [f64; 3]| {
        let own = points.iter();
        own.map(|[x, y]| r[0] + r[1] * (2.0 * x - 1.0) + r[2] * (2.0 * y - 1.0))
            .collect()
    };
    let rigid = Theory::Sheared.rigid_motions(supports);
    columns.extend(rigid.into_iter().map(at));
    for k in 0..GUARD {
        let (along, across) = ((k + 2) as f64, (GUARD - k) as f64);
        let wave = |[x, y]: &[f64; 2]| (along * PI * x).cos() * (across * PI * y).cos();
        columns.push(points.iter().map(wave).collect());
    }
    let column = |w: &Vec<f64>| {
        let mut all = DVector::zeros(PER_NODE * w.len());
        all.iter_mut()
            .step_by(PER_NODE)
            .zip(w)
            .for_each(|(to, w)| *to = *w);
        let size = all.norm();
        all / size
    };
    DMatrix::from_columns(&columns.iter().map(column).collect::<Vec<_>>())
}

/// For each of the first `count` columns the row that it resembles most, every row taken once.
fn partners(products: &DMatrix<f64>, count: usize) -> Vec<usize> {
    let norms: Vec<f64> = products.column_iter().map(|c| c.norm()).collect();
    let mut pairs: Vec<(f64, usize, usize)> = (0..count)
        .flat_map(|column| (0..products.nrows()).map(move |row| (row, column)))
        .map(|(row, column)| (products[(row, column)].abs() / norms[column], row, column))
        .collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut found, mut taken) = (vec![usize::MAX; count], vec![false; products.nrows()]);
    for (_, row, column) in pairs {
        if found[column] == usize::MAX && !taken[row] {
            found[column] = row;
            taken[row] = true;
        }
    }
    found
}
