//! Names for the sides of a mesh whose file names none: those of its box, the parts between corners, and its holes.

use std::collections::BTreeMap;

use super::mesh::{BoundaryEdge, ImportedMesh};
use crate::geometry::HOLE;

/// The sides of the box: lowest and highest x, lowest and highest y.
const BOX: [&str; 4] = ["x_min", "x_max", "y_min", "y_max"];

/// A node is on a side of the box if it is this close to it, as a share of the mesh's size.
const ON_BOX: f64 = 1e-6;

/// The boundary turns by more than this at a corner, degrees; arcs are meshed finer.
const CORNER_DEG: f64 = 40.0;

/// Sides by name, of the whole boundary in the order of [`super::sides::in_order`].
pub(super) fn proposed(
    mesh: &ImportedMesh,
    boundary: &[BoundaryEdge],
) -> BTreeMap<String, Vec<BoundaryEdge>> {
    let mut named: BTreeMap<String, Vec<BoundaryEdge>> = BTreeMap::new();
    let follows =
        |a: &BoundaryEdge, b: &BoundaryEdge| mesh.edge_nodes(*a).2 == mesh.edge_nodes(*b).0;
    let loops = boundary.chunk_by(follows);
    let (outer, holes): (Vec<_>, Vec<_>) = loops.partition(|l| is_outer(mesh, l));
    for (k, hole) in holes.iter().enumerate() {
        let name = match (mesh.circle_along(hole), holes.len()) {
            (Some(_), 1) => HOLE.to_string(),
            (Some(_), _) => format!("{HOLE}_{}", k + 1),
            (None, _) => format!("inner_{}", k + 1),
        };
        named.insert(name, hole.to_vec());
    }
    let mut between = 0;
    for part in outer.into_iter().flat_map(|l| parts(mesh, l)) {
        let on_box = part.first().and_then(|edge| on_box(mesh, *edge));
        let name = on_box.map_or_else(
            || {
                between += 1;
                format!("side_{between}")
            },
            |side| BOX[side].to_string(),
        );
        named.entry(name).or_default().extend(part);
    }
    named
}

/// Whether a loop has the mesh inside, as the outline does and holes do not.
fn is_outer(mesh: &ImportedMesh, edges: &[BoundaryEdge]) -> bool {
    let cross = |edge: &BoundaryEdge| {
        let [a, b] = chord(mesh, *edge);
        a[0] * b[1] - a[1] * b[0]
    };
    edges.iter().map(cross).sum::<f64>() > 0.0
}

fn chord(mesh: &ImportedMesh, edge: BoundaryEdge) -> [[f64; 2]; 2] {
    let (a, _, b) = mesh.edge_nodes(edge);
    [a, b].map(|n| mesh.nodes[n as usize])
}

/// The side of the box that an edge lies on.
fn on_box(mesh: &ImportedMesh, edge: BoundaryEdge) -> Option<usize> {
    let [low, high] = mesh.bounds();
    let room = ON_BOX * (high[0] - low[0]).max(high[1] - low[1]);
    let ends = chord(mesh, edge);
    (0..BOX.len()).find(|side| {
        let limit = [low, high][side % 2][side / 2];
        ends.iter().all(|p| (p[side / 2] - limit).abs() <= room)
    })
}

/// A loop cut at its corners and where it leaves the box.
fn parts(mesh: &ImportedMesh, outline: &[BoundaryEdge]) -> Vec<Vec<BoundaryEdge>> {
    let sides: Vec<Option<usize>> = outline.iter().map(|e| on_box(mesh, *e)).collect();
    let along: Vec<[f64; 2]> = outline
        .iter()
        .map(|e| {
            let [a, b] = chord(mesh, *e);
            [b[0] - a[0], b[1] - a[1]]
        })
        .collect();
    let count = outline.len();
    let begins = |k: usize| {
        let before = (k + count - 1) % count;
        let ([a, b], [c, d]) = (along[before], along[k]);
        let turn = (a * d - b * c).atan2(a * c + b * d);
        sides[before] != sides[k] || (sides[k].is_none() && turn.to_degrees().abs() > CORNER_DEG)
    };
    let first = (0..count).find(|k| begins(*k)).unwrap_or(0);
    let mut parts: Vec<Vec<BoundaryEdge>> = Vec::new();
    for k in (first..count).chain(0..first) {
        match parts.last_mut().filter(|_| !begins(k)) {
            Some(part) => part.push(outline[k]),
            None => parts.push(vec![outline[k]]),
        }
    }
    parts
}
