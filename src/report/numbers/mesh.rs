//! The lines of the picture of a mesh: elements, named edges, what acts on them, and the measured points.

use std::collections::BTreeMap;

use super::data::{MeshPart, MeshPoint};
use crate::fem::Locator;
use crate::field::Frame;
use crate::geometry::{Edge, EdgeForce, HIGH, LOW, Mesh};

/// Elements are drawn up to this many; of a finer mesh the boundary alone is.
const MOST_ELEMENTS: usize = 6000;

/// Measured points that are drawn at most.
const MOST_POINTS: usize = 2000;

/// The picture's lines and points in the data's frame. `points` are measured places there.
pub fn lines(mesh: &Mesh, frame: &Frame, points: &[[f64; 2]]) -> Vec<MeshPoint> {
    let mut lines = Lines {
        found: Vec::new(),
        count: 0,
    };
    let at = |n: &u32| frame.data_point(mesh.nodes[*n as usize]);
    let SideNumbers {
        inner,
        joint,
        boundary,
    } = sides(mesh);
    if mesh.elements.len() <= MOST_ELEMENTS {
        for trail in trails(mesh, &inner) {
            lines.add(MeshPart::Element, "", trail.iter().map(at));
        }
    }
    for (part, sides) in [(MeshPart::Joint, &joint), (MeshPart::Boundary, &boundary)] {
        for side in sides {
            lines.add(part, "", side.iter().map(at));
        }
    }
    for (name, edges) in &mesh.edges {
        for edge in edges {
            lines.add(MeshPart::Edge, name, edge.iter().map(at));
        }
    }
    let [s, t] = mesh.extents;
    let arrow = 0.08 * (s[1] - s[0]).hypot(t[1] - t[0]);
    for (name, direction) in pulled(mesh) {
        if let Some(middle) = middle(mesh, name) {
            let tip = [0, 1].map(|k| middle[k] + arrow * direction[k]);
            lines.add(
                MeshPart::Force,
                name,
                [middle, tip].map(|p| frame.data_point(p)),
            );
        }
    }
    let held = mesh.boundary.iter().flat_map(|b| &b.held);
    for (name, _) in held {
        let nodes = mesh.edge(name).iter().map(|edge| at(&edge[1]));
        nodes.for_each(|p| lines.add(MeshPart::Held, name, [p]));
    }
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    let shown: Vec<[f64; 2]> = points.iter().step_by(stride).copied().collect();
    for (p, holds) in shown.iter().zip(on_mesh(mesh, frame, &shown)) {
        let part = if holds { MeshPart::On } else { MeshPart::Off };
        lines.add(part, "", [*p]);
    }
    lines.found
}

/// Which of some measured places, in the data's frame, lie on the mesh.
pub fn on_mesh(mesh: &Mesh, frame: &Frame, points: &[[f64; 2]]) -> Vec<bool> {
    let points: Vec<[f64; 2]> = points.iter().map(|&p| frame.point(p)).collect();
    Locator::new(mesh).holds(&points)
}

struct Lines {
    found: Vec<MeshPoint>,
    count: usize,
}

impl Lines {
    fn add(&mut self, part: MeshPart, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let line = self.count;
        let short = |x: f64| (1e4 * x).round() / 1e4;
        self.found.extend(points.into_iter().map(|p| MeshPoint {
            part,
            name: name.into(),
            line,
            x_mm: short(p[0]),
            y_mm: short(p[1]),
        }));
        self.count += 1;
    }
}

/// The edges that a force pulls and along which direction: of a strip, its ends.
fn pulled(mesh: &Mesh) -> Vec<(&str, [f64; 2])> {
    let Some(boundary) = &mesh.boundary else {
        return vec![(HIGH, [1.0, 0.0]), (LOW, [-1.0, 0.0])];
    };
    let of = |load: &EdgeForce| load.direction;
    let loads = boundary.loads.iter();
    loads
        .flat_map(|load| load.edges.iter().map(move |name| (name.as_str(), of(load))))
        .collect()
}

/// The mean of an edge's nodes.
fn middle(mesh: &Mesh, name: &str) -> Option<[f64; 2]> {
    let edges = mesh.edge(name);
    let count = edges.len() as f64;
    let mean = |k: usize| {
        edges
            .iter()
            .map(|e| mesh.nodes[e[1] as usize][k])
            .sum::<f64>()
            / count
    };
    (!edges.is_empty()).then(|| [mean(0), mean(1)])
}

/// Sides of elements.
#[derive(Default)]
struct SideNumbers {
    /// Those that two of one stack share.
    inner: Vec<Edge>,
    /// Those between two stacks.
    joint: Vec<Edge>,
    /// Those of one element.
    boundary: Vec<Edge>,
}

fn sides(mesh: &Mesh) -> SideNumbers {
    let mut seen: BTreeMap<[u32; 2], (Edge, Vec<usize>)> = BTreeMap::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        for k in 0..4 {
            let (a, b) = (element[k], element[(k + 1) % 4]);
            let side = [a, element[4 + k], b];
            let of = seen.entry([a.min(b), a.max(b)]);
            of.or_insert((side, Vec::new())).1.push(mesh.region_of(e));
        }
    }
    let mut sides = SideNumbers::default();
    for (side, stacks) in seen.into_values() {
        let kind = match &stacks[..] {
            [_] => &mut sides.boundary,
            [first, others @ ..] if others.iter().any(|s| s != first) => &mut sides.joint,
            _ => &mut sides.inner,
        };
        kind.push(side);
    }
    sides
}

/// Sides as few long lines: each goes on as long as there is a side that was not walked.
fn trails(mesh: &Mesh, sides: &[Edge]) -> Vec<Vec<u32>> {
    let mut at_node = vec![Vec::new(); mesh.nodes.len()];
    for (k, [a, _, b]) in sides.iter().enumerate() {
        at_node[*a as usize].push(k);
        at_node[*b as usize].push(k);
    }
    let mut walked = vec![false; sides.len()];
    let mut trails = Vec::new();
    for start in 0..sides.len() {
        if walked[start] {
            continue;
        }
        let mut here = sides[start][0];
        let mut trail = vec![here];
        while let Some(&k) = at_node[here as usize].iter().find(|k| !walked[**k]) {
            walked[k] = true;
            let [a, middle, b] = sides[k];
            here = if a == here { b } else { a };
            trail.extend([middle, here]);
        }
        trails.push(trail);
    }
    trails
}
