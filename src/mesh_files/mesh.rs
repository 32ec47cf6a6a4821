//! The imported mesh: nodes, elements of four kinds, named edges and regions.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::kind::ElementKind;
use crate::numeric::range;

/// An element: corners counter-clockwise, then the midside nodes of sides 0-1, 1-2, and so on.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Element {
    pub kind: ElementKind,
    /// Indices of its nodes; places that the kind does not have hold [`Element::NONE`].
    pub all: [u32; 8],
}

impl Element {
    /// Fills the places of nodes that a kind does not have.
    pub const NONE: u32 = u32::MAX;

    /// Indices of its nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.all[..self.kind.nodes()]
    }

    /// Indices of its corners.
    pub fn corners(&self) -> &[u32] {
        &self.all[..self.kind.corners()]
    }

    /// The corners that a side (below the number of corners) runs between, counter-clockwise.
    pub fn side(&self, side: usize) -> [u32; 2] {
        let n = self.kind.corners();
        [self.all[side % n], self.all[(side + 1) % n]]
    }

    /// The midside node of a side, if the element is quadratic.
    pub fn midside(&self, side: usize) -> Option<u32> {
        let n = self.kind.corners();
        self.kind.is_quadratic().then(|| self.all[n + side % n])
    }

    /// The same element run through in the other sense; its side k becomes side n - 1 - k.
    #[must_use]
    pub(super) fn reversed(&self) -> Self {
        let n = self.kind.corners();
        let mut all = self.all;
        for k in 0..n {
            all[k] = self.all[(n - k) % n];
            if self.kind.is_quadratic() {
                all[n + k] = self.all[2 * n - 1 - k];
            }
        }
        Self {
            kind: self.kind,
            all,
        }
    }
}

/// A side of an element that lies on the boundary, with the material on its left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
pub struct BoundaryEdge {
    /// Index of the element.
    pub element: usize,
    /// From corner `side` to the next one.
    pub side: usize,
}

/// A mesh that another program made. All elements are linear or all are quadratic; the mesh is one part, without
/// coincident or hanging nodes.
#[derive(Debug, Clone, Default)]
pub struct ImportedMesh {
    /// Coordinates, mm; every node belongs to an element.
    pub nodes: Vec<[f64; 2]>,
    pub elements: Vec<Element>,
    /// Parts of the boundary by name: in order along it where they form a chain, counter-clockwise about the plate and
    /// clockwise about a hole.
    pub edges: BTreeMap<String, Vec<BoundaryEdge>>,
    /// Indices of elements by name, increasing.
    pub regions: BTreeMap<String, Vec<usize>>,
    /// The files it was read from, the first one first.
    pub files: Vec<PathBuf>,
    /// What the reader left out, a sentence each; see [`ImportedMesh::warnings`].
    pub remarks: Vec<String>,
}

/// A mesh less than this across is not likely to be in mm.
const SMALLEST_MM: f64 = 1.0;

impl ImportedMesh {
    /// Lowest and highest coordinates, mm.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        let [x, y] = [0, 1].map(|k| range(self.nodes.iter().map(|p| p[k])));
        [[x[0], y[0]], [x[1], y[1]]]
    }

    /// Area of an element, mm^2.
    pub fn area_of(&self, element: usize) -> f64 {
        let element = &self.elements[element];
        (0..element.kind.corners())
            .map(|side| {
                let [a, b] = element.side(side).map(|n| self.nodes[n as usize]);
                let chord = 0.5 * (a[0] * b[1] - a[1] * b[0]);
                // a parabola's segment: 2/3 of its triangle's double area
                let segment = element.midside(side).map_or(0.0, |m| {
                    let m = self.nodes[m as usize];
                    let cross = (m[0] - a[0]) * (b[1] - a[1]) - (m[1] - a[1]) * (b[0] - a[0]);
                    2.0 / 3.0 * cross
                });
                chord + segment
            })
            .sum()
    }

    /// The nodes of a boundary edge: corner, midside if there is one, corner.
    pub fn edge_nodes(&self, edge: BoundaryEdge) -> (u32, Option<u32>, u32) {
        let element = &self.elements[edge.element];
        let [a, b] = element.side(edge.side);
        (a, element.midside(edge.side), b)
    }

    /// What a user should know before the mesh is used: a size that looks like another unit than mm, what the reader
    /// left out, an edge or a region that is missing.
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        let [low, high] = self.bounds();
        let across = (high[0] - low[0]).max(high[1] - low[1]);
        if across < SMALLEST_MM {
            all.push(format!(
                "the mesh is {across:.3e} mm across: its coordinates look like metres; lengths are in mm, scale it by 1000"
            ));
        }
        if self.edges.is_empty() {
            all.push(
                "the mesh has no named edge: loads and supports have nothing to act on".to_string(),
            );
        }
        all.extend(self.remarks.iter().cloned());
        all
    }
}

/// An edge or a region that a mesh file has, in words.
pub(super) fn named<'a>(
    what: &str,
    names: impl Iterator<Item = &'a String>,
    file: &Path,
) -> String {
    let names: Vec<&str> = names.map(String::as_str).collect();
    let file = file.display();
    match names.is_empty() {
        true => format!("a named {what}, of which {file} has none"),
        false => format!("one of the {what}s of {file}: {}", names.join(", ")),
    }
}
