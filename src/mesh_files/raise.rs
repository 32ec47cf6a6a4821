//! Linear elements made quadratic.

use std::collections::HashMap;

use super::curved::bend;
use super::mesh::{Element, ImportedMesh};

/// The same mesh of quadratic elements (T3 to T6, Q4 to Q8). Elements share the node in the middle of a shared side. Sides stay straight, but
/// for those on a smooth curved edge, which are bent to it. Edges and regions are kept; a mesh that is quadratic already is returned as it
/// is.
#[must_use]
pub fn raise(mut mesh: ImportedMesh) -> ImportedMesh {
    if mesh.elements.iter().all(|e| e.kind.is_quadratic()) {
        return mesh;
    }
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    for element in &mut mesh.elements {
        if element.kind.is_quadratic() {
            continue;
        }
        let corners = element.kind.corners();
        let mut all = [Element::NONE; 8];
        all[..corners].copy_from_slice(element.corners());
        for side in 0..corners {
            let [a, b] = element.side(side);
            all[corners + side] = *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [p, q] = [a, b].map(|n| mesh.nodes[n as usize]);
                mesh.nodes.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                (mesh.nodes.len() - 1) as u32
            });
        }
        *element = Element {
            kind: element.kind.quadratic(),
            all,
        };
    }
    bend(&mut mesh);
    mesh
}
