//! Nodes, eight-node quadrilaterals (Q8) and named edges; blocks of elements on lattices of nodes.

use std::collections::BTreeMap;
use std::sync::Arc;

/// An element's edge on the boundary: corner, midside, corner, with the material on its left.
pub type Edge = [u32; 3];

/// Nodes and Q8 elements.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Node coordinates (direction 1, direction 2), mm.
    pub nodes: Vec<[f64; 2]>,
    /// Corners counter-clockwise, then the midside nodes of edges 0-1, 1-2, 2-3, 3-0.
    pub elements: Vec<[u32; 8]>,
    /// The stack of each element: 0 the specimen's, others by their number; empty where all have the specimen's.
    pub region: Vec<u8>,
    /// The boundary by name, each part of it in order: counter-clockwise about the plate, clockwise about a hole.
    pub edges: BTreeMap<String, Vec<Edge>>,
    /// Extents of the parallel part, as [`super::Geometry::extents`].
    pub extents: [[f64; 2]; 2],
    /// What loads and holds it; none of a strip, whose ends are pulled.
    pub boundary: Option<Arc<Boundary>>,
}

/// What loads and holds a mesh through edges of any names. Directions are along (direction 1, direction 2).
#[derive(Debug)]
pub struct Boundary {
    pub loads: Vec<EdgeForce>,
    /// Edges along which components of the displacement are zero.
    pub held: Vec<(String, [bool; 2])>,
}

impl Boundary {
    /// The edges whose tractions are not known, in the order in which they were declared.
    pub fn introductions(&self) -> impl Iterator<Item = &EdgeForce> {
        self.loads.iter().filter(|l| l.is_measured)
    }
}

/// The whole force of a test on some edges.
#[derive(Debug)]
pub struct EdgeForce {
    pub edges: Vec<String>,
    /// Unit vector along which a positive force pulls.
    pub direction: [f64; 2],
    /// Whether a stiff grip guides the edges: they move alike along the direction, and not across it.
    pub is_grip: bool,
    /// Whether the measurement, not the model, says how the force is spread.
    pub is_measured: bool,
}

/// Edges of a mesh, at most, whose tractions the measurement has to tell.
pub const INTRODUCTIONS: usize = 2;

/// Index of a lattice point that no Q8 element has (the middle of an element).
pub const NONE: u32 = u32::MAX;

/// A structured block's nodes: `id[i][j]` on a lattice of corners and midsides.
pub type Lattice = Vec<Vec<u32>>;

impl Mesh {
    /// Degrees of freedom: two a node.
    pub fn unknowns(&self) -> usize {
        2 * self.nodes.len()
    }

    /// Coordinates of an element's eight nodes.
    pub fn corners(&self, element: usize) -> [[f64; 2]; 8] {
        self.elements[element].map(|n| self.nodes[n as usize])
    }

    /// The stack of an element, as [`Mesh::region`].
    pub fn region_of(&self, element: usize) -> usize {
        self.region.get(element).copied().unwrap_or(0).into()
    }

    /// How many stacks there are, the specimen's among them.
    pub fn stacks(&self) -> usize {
        1 + usize::from(self.region.iter().copied().max().unwrap_or(0))
    }

    /// How many edges have tractions that are not known.
    pub fn introductions(&self) -> usize {
        let boundary = self.boundary.as_ref();
        boundary.map_or(0, |b| b.introductions().count().min(INTRODUCTIONS))
    }

    /// The edges of a name; none if there are none.
    pub fn edge(&self, name: &str) -> &[Edge] {
        self.edges.get(name).map_or(&[], Vec::as_slice)
    }

    /// Name the edges along chains of nodes (corner, midside, corner, ...).
    pub(super) fn name_edges(&mut self, name: &str, chains: &[Vec<u32>]) {
        let edges = chains.iter().flat_map(|chain| {
            let starts = (0..chain.len().saturating_sub(2)).step_by(2);
            starts.map(|i| [chain[i], chain[i + 1], chain[i + 2]])
        });
        self.edges.insert(name.into(), edges.collect());
    }

    pub(crate) fn add_node(&mut self, p: [f64; 2]) -> u32 {
        self.nodes.push(p);
        (self.nodes.len() - 1) as u32
    }

    /// The elements of a lattice of nodes `id[i][j]`, turned counter-clockwise.
    pub(super) fn add_elements(&mut self, id: &Lattice) {
        for i in (0..id.len() - 1).step_by(2) {
            for j in (0..id[0].len() - 1).step_by(2) {
                let at = |di: usize, dj: usize| id[i + di][j + dj];
                let [a, b, c, d] = [at(0, 0), at(2, 0), at(2, 2), at(0, 2)];
                let [ab, bc, cd, da] = [at(1, 0), at(2, 1), at(1, 2), at(0, 1)];
                self.elements.push(if self.turns_left(a, b, c) {
                    [a, b, c, d, ab, bc, cd, da]
                } else {
                    [a, d, c, b, da, cd, bc, ab]
                });
            }
        }
    }

    fn turns_left(&self, a: u32, b: u32, c: u32) -> bool {
        let [a, b, c] = [a, b, c].map(|n| self.nodes[n as usize]);
        (b[0] - a[0]) * (c[1] - b[1]) > (b[1] - a[1]) * (c[0] - b[0])
    }
}
