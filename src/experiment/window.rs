//! Which part of a mesh a window of measured points needs.

use std::collections::BTreeSet;

use crate::error::Error;
use crate::geometry::Mesh;

/// A window with a margin around it.
pub(super) fn widened([low, high]: [[f64; 2]; 2], by: f64) -> [[f64; 2]; 2] {
    [low.map(|x| x - by), high.map(|x| x + by)]
}

/// Nodes of all elements whose bounding box meets the window, in increasing order.
pub(super) fn window_nodes(mesh: &Mesh, [low, high]: [[f64; 2]; 2]) -> Vec<u32> {
    let mut nodes = BTreeSet::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let x = mesh.corners(e);
        let outside = (0..2).any(|k| {
            let (min, max) = x
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p[k]), b.max(p[k]))
                });
            let margin = 0.125 * (max - min) + 1e-6;
            max + margin < low[k] || min - margin > high[k]
        });
        if !outside {
            nodes.extend(element);
        }
    }
    nodes.into_iter().collect()
}

/// What is wrong of points between the corners of `window` where none lies on a plate of these extents, mm.
pub(super) fn off_the_plate([low, high]: [[f64; 2]; 2], [s, t]: [[f64; 2]; 2]) -> Error {
    Error::input("measurement", "points on the plate")
        .found(format!("points between {low:.2?} and {high:.2?} mm"))
        .hint(format!(
            "the plate spans {s:.2?} mm along the load and {t:.2?} mm across it, from the point at hole_center_in_data_mm; check that, the units and, of a mesh, origin_mm and mm_per_unit"
        ))
}
