//! Elements of any kind as eight-node quadrilaterals (Q8), and Q8 halved: an element is split at its middle and at the middles of its
//! sides, a triangle into three, a quadrilateral into four. Sides stay the parabolas that they are.

use std::collections::{BTreeMap, HashMap};

use super::jacobian::line_point;
use super::kind::ElementKind;
use super::mesh::{Element, ImportedMesh};
use crate::geometry::{Edge, Mesh};

/// A quadratic mesh as Q8: the same elements where all are Q8 already, or else all of them split. `region` is that of each element, or
/// empty, as [`Mesh::region`].
pub(super) fn quads(mesh: &ImportedMesh, region: &[u8]) -> Mesh {
    let edge = |edge: &super::BoundaryEdge| {
        let (a, m, b) = mesh.edge_nodes(*edge);
        [a, m.unwrap_or(a), b]
    };
    let named = mesh.edges.iter();
    let named = named.map(|(name, all)| (name.clone(), all.iter().map(edge).collect()));
    let edges: BTreeMap<String, Vec<Edge>> = named.collect();
    if mesh.elements.iter().any(|e| e.kind != ElementKind::Q8) {
        return split(mesh.nodes.clone(), &mesh.elements, region, &edges);
    }
    Mesh {
        nodes: mesh.nodes.clone(),
        elements: mesh.elements.iter().map(|e| e.all).collect(),
        region: region.to_vec(),
        edges,
        ..Mesh::default()
    }
}

/// Every element split in four.
pub(super) fn halved(mesh: Mesh) -> Mesh {
    let element = |all: &[u32; 8]| Element {
        kind: ElementKind::Q8,
        all: *all,
    };
    let elements: Vec<Element> = mesh.elements.iter().map(element).collect();
    Mesh {
        extents: mesh.extents,
        boundary: mesh.boundary,
        ..split(mesh.nodes, &elements, &mesh.region, &mesh.edges)
    }
}

/// Weights of a corner and of a midside node in an element's middle.
fn in_middle(corners: usize) -> [f64; 2] {
    match corners {
        3 => [-1.0 / 9.0, 4.0 / 9.0],
        _ => [-0.25, 0.5],
    }
}

/// Weights of the corner and of the midside node `k` places after those of a side, half-way from that side's middle to the element's:
/// in a triangle at the area coordinates (5/12, 5/12, 1/6), in a quadrilateral at the local coordinates (0, -1/2).
fn on_spoke(corners: usize, k: usize) -> [f64; 2] {
    match (corners, k) {
        (3, 0) => [-5.0 / 72.0, 25.0 / 36.0],
        (3, 1) => [-5.0 / 72.0, 5.0 / 18.0],
        (3, _) => [-1.0 / 9.0, 5.0 / 18.0],
        (_, 0) => [-0.1875, 0.75],
        (_, 2) => [-0.1875, 0.25],
        _ => [-0.1875, 0.375],
    }
}

/// Splits elements, and shares the nodes of their sides.
struct Splitter {
    mesh: Mesh,
    /// The node between a corner and the midside node of a side.
    quarters: HashMap<[u32; 2], u32>,
}

impl Splitter {
    /// The nodes at a quarter and at three quarters of a side (corner, midside, corner).
    fn quarters(&mut self, [a, m, b]: Edge) -> [u32; 2] {
        let at = |n: u32| self.mesh.nodes[n as usize];
        let parabola = [at(a), at(m), at(b)];
        [(a, 0.25), (b, 0.75)].map(|(corner, t)| {
            *self.quarters.entry([corner, m]).or_insert_with(|| {
                let [a, m, b] = parabola;
                self.mesh.add_node(line_point(a, m, b, t))
            })
        })
    }

    fn element(&mut self, element: &Element) {
        let n = element.kind.corners();
        let all = element.all;
        let blend = |nodes: &[[f64; 2]], weights: &dyn Fn(usize) -> [f64; 2]| {
            let mut p = [0.0; 2];
            for k in 0..n {
                for (node, w) in [all[k], all[n + k]].into_iter().zip(weights(k)) {
                    let x = nodes[node as usize];
                    p = [p[0] + w * x[0], p[1] + w * x[1]];
                }
            }
            p
        };
        let middle = blend(&self.mesh.nodes, &|_| in_middle(n));
        let middle = self.mesh.add_node(middle);
        let mut spokes = [0; 4];
        let mut sides = [[0; 2]; 4];
        for side in 0..n {
            let p = blend(&self.mesh.nodes, &|k| on_spoke(n, (k + n - side) % n));
            spokes[side] = self.mesh.add_node(p);
            sides[side] = self.quarters([all[side], all[n + side], all[(side + 1) % n]]);
        }
        for k in 0..n {
            let before = (k + n - 1) % n;
            self.mesh.elements.push([
                all[k],
                all[n + k],
                middle,
                all[n + before],
                sides[k][0],
                spokes[k],
                spokes[before],
                sides[before][1],
            ]);
        }
    }
}

fn split(
    nodes: Vec<[f64; 2]>,
    elements: &[Element],
    region: &[u8],
    edges: &BTreeMap<String, Vec<Edge>>,
) -> Mesh {
    let mesh = Mesh {
        nodes,
        ..Mesh::default()
    };
    let mut splitter = Splitter {
        mesh,
        quarters: HashMap::new(),
    };
    for element in elements {
        splitter.element(element);
    }
    let parts = elements.iter().zip(region);
    let of_parts = parts.flat_map(|(e, &region)| std::iter::repeat_n(region, e.kind.corners()));
    splitter.mesh.region = of_parts.collect();
    for (name, all) in edges {
        let halves = all.iter().flat_map(|&[a, m, b]| {
            let [first, second] = splitter.quarters([a, m, b]);
            [[a, first, m], [m, second, b]]
        });
        let halves = halves.collect();
        splitter.mesh.edges.insert(name.clone(), halves);
    }
    splitter.mesh
}
