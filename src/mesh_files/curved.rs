//! Straight sides of a linear mesh that lie on a smooth edge, bent to it.

use std::collections::HashMap;

use super::mesh::ImportedMesh;

/// An edge turns by less at a node where it is smooth, degrees: a circle of at least twelve sides does.
const SMOOTH_DEG: f64 = 31.0;

/// A side is bent only if the edge turns to the same side at both of its ends, at one by no less than this share of the other. Where a
/// straight part meets an arc of sides of one length that is zero.
const EVEN: f64 = 0.3;

/// Largest rise of a side over its element's height: what is flatter would fold.
const FLATTEST: f64 = 0.2;

/// Move the midside nodes of smooth edges onto the arc that turns as the edge does at both ends: of a circle that is the circle.
pub(super) fn bend(mesh: &mut ImportedMesh) {
    let sides = boundary(mesh);
    let mut starting: HashMap<u32, Option<usize>> = HashMap::new();
    let mut ending = starting.clone();
    for (k, side) in sides.iter().enumerate() {
        for (at, node) in [(&mut starting, side.ends[0]), (&mut ending, side.ends[1])] {
            // where parts touch in a node, no edge goes on
            at.entry(node).and_modify(|k| *k = None).or_insert(Some(k));
        }
    }
    let along = |k: usize| chord(mesh, sides[k].ends);
    let turn = |a: usize, b: usize| {
        let ([a, b], [c, d]) = (along(a), along(b));
        (a * d - b * c).atan2(a * c + b * d)
    };
    let mut moved: Vec<(u32, [f64; 2])> = Vec::new();
    for (k, side) in sides.iter().enumerate() {
        let neighbour = |of: &HashMap<u32, Option<usize>>, end: usize| {
            of.get(&side.ends[end]).copied().flatten()
        };
        let (Some(before), Some(after)) = (neighbour(&ending, 0), neighbour(&starting, 1)) else {
            continue;
        };
        let [first, last] = [turn(before, k), turn(k, after)];
        let [less, more] = [first.abs().min(last.abs()), first.abs().max(last.abs())];
        let is_even = first * last > 0.0 && less >= EVEN * more;
        if !is_even || more >= SMOOTH_DEG.to_radians() {
            continue;
        }
        let [dx, dy] = along(k);
        // an arc over a chord c that turns by an angle has the rise c / 2 tan(angle / 4), to the right of one that turns left
        let rise = 0.5 * (0.125 * (first + last)).tan();
        let length = dx.hypot(dy);
        if rise.abs() * length > FLATTEST * 2.0 * mesh.area_of(side.element) / length {
            continue;
        }
        let middle = mesh.nodes[side.middle as usize];
        moved.push((side.middle, [middle[0] + rise * dy, middle[1] - rise * dx]));
    }
    for (node, place) in moved {
        mesh.nodes[node as usize] = place;
    }
}

/// A side on the boundary, with the material on its left.
struct Side {
    element: usize,
    ends: [u32; 2],
    middle: u32,
}

fn boundary(mesh: &ImportedMesh) -> Vec<Side> {
    let mut all: Vec<Side> = Vec::new();
    let mut owners: HashMap<u32, usize> = HashMap::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        for side in 0..element.kind.corners() {
            if let Some(middle) = element.midside(side) {
                *owners.entry(middle).or_default() += 1;
                all.push(Side {
                    element: e,
                    ends: element.side(side),
                    middle,
                });
            }
        }
    }
    all.retain(|side| owners[&side.middle] == 1);
    all
}

fn chord(mesh: &ImportedMesh, ends: [u32; 2]) -> [f64; 2] {
    let [a, b] = ends.map(|n| mesh.nodes[n as usize]);
    [b[0] - a[0], b[1] - a[1]]
}
