//! Where a mesh does not hang together: coincident nodes, hanging nodes, separate parts.

use super::draft::Draft;
use super::jacobian::line_point;
use super::mesh::{BoundaryEdge, Element};
use super::sides::{ElementSides, MERGE};
use crate::error::{Error, Result};

/// Nodes nearer than this fraction of the shortest side are one node: far above the rounding of a file's digits, far
/// below any gap that a mesh can resolve.
const COINCIDENT: f64 = 1e-3;

/// A node nearer to a side than this fraction of its length hangs on it.
const HANGING: f64 = 1e-4;

/// Distance along a direction that no mesh is aligned with, 1 rad from the x axis.
fn oblique(p: [f64; 2]) -> f64 {
    0.540_302_305_868_139_8 * p[0] + 0.841_470_984_807_896_5 * p[1]
}

/// Nodes sorted by their oblique place.
fn sorted(nodes: &[[f64; 2]], which: impl Iterator<Item = u32>) -> Vec<(f64, u32)> {
    let mut all: Vec<(f64, u32)> = which.map(|n| (oblique(nodes[n as usize]), n)).collect();
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A mesh in the making.
#[derive(Clone, Copy)]
pub(super) struct SeamParts<'a> {
    pub draft: &'a Draft,
    /// The draft's index of every node.
    pub kept: &'a [u32],
    pub nodes: &'a [[f64; 2]],
    pub elements: &'a [Element],
    pub sides: &'a ElementSides,
}

impl SeamParts<'_> {
    /// Refuse coincident nodes, hanging nodes and separate parts.
    ///
    /// # Errors
    /// The input's fault, with what to do in Gmsh and in Abaqus.
    pub fn check(&self) -> Result<()> {
        self.coincident()?;
        self.two_roles()?;
        self.hanging()?;
        self.apart()
    }

    fn place(&self, node: u32) -> String {
        self.draft.place_of_node(self.kept[node as usize] as usize)
    }

    fn number(&self, node: u32) -> u64 {
        self.draft.nodes[self.kept[node as usize] as usize].number
    }

    fn coincident(&self) -> Result<()> {
        let mut shortest = f64::INFINITY;
        for element in self.elements {
            for side in 0..element.kind.corners() {
                let [a, b] = element.side(side).map(|n| self.nodes[n as usize]);
                shortest = shortest.min(distance(a, b));
            }
        }
        let near = COINCIDENT * shortest;
        let order = sorted(self.nodes, 0..self.nodes.len() as u32);
        for (i, &(at, a)) in order.iter().enumerate() {
            let window = order[i + 1..]
                .iter()
                .take_while(|(other, _)| other - at <= near);
            for &(_, b) in window {
                let [p, q] = [a, b].map(|n| self.nodes[n as usize]);
                if distance(p, q) <= near {
                    let (first, second) = (a.min(b), a.max(b));
                    return Err(Error::input(
                        self.place(second),
                        "one node at a place; a crack must be open by a gap",
                    )
                    .found(format!(
                        "the place of node {}, ({}, {}) mm",
                        self.number(first),
                        q[0],
                        q[1]
                    ))
                    .hint(MERGE));
                }
            }
        }
        Ok(())
    }

    /// A node in the middle of one element's side and at the corner of another hangs.
    fn two_roles(&self) -> Result<()> {
        let mut corner = vec![false; self.nodes.len()];
        for element in self.elements {
            for &n in element.corners() {
                corner[n as usize] = true;
            }
        }
        for (e, element) in self.elements.iter().enumerate() {
            let middles = &element.nodes()[element.kind.corners()..];
            if let Some(&n) = middles.iter().find(|n| corner[**n as usize]) {
                return Err(self.hangs(n, e));
            }
        }
        Ok(())
    }

    fn hanging(&self) -> Result<()> {
        let boundary: Vec<BoundaryEdge> = self.sides.boundary().collect();
        let mut on_boundary = vec![false; self.nodes.len()];
        for edge in &boundary {
            let element = &self.elements[edge.element];
            for n in element
                .side(edge.side)
                .into_iter()
                .chain(element.midside(edge.side))
            {
                on_boundary[n as usize] = true;
            }
        }
        let candidates = (0..self.nodes.len() as u32).filter(|n| on_boundary[*n as usize]);
        let order = sorted(self.nodes, candidates);
        for edge in &boundary {
            if let Some(n) = self.hanging_on(*edge, &order) {
                return Err(self.hangs(n, edge.element));
            }
        }
        Ok(())
    }

    /// A node, of those in order, that lies on a boundary edge between its corners.
    fn hanging_on(&self, edge: BoundaryEdge, order: &[(f64, u32)]) -> Option<u32> {
        let element = &self.elements[edge.element];
        let [a, b] = element.side(edge.side);
        let own = [a, b, element.midside(edge.side).unwrap_or(a)];
        let [p, q] = [a, b].map(|n| self.nodes[n as usize]);
        let straight = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        let middle = element
            .midside(edge.side)
            .map_or(straight, |m| self.nodes[m as usize]);
        let chord = distance(p, q);
        let near = HANGING * chord;
        let bulge = distance(middle, straight) + near;
        let (from, to) = (oblique(p).min(oblique(q)), oblique(p).max(oblique(q)));
        let first = order.partition_point(|(at, _)| *at < from - bulge);
        let window = order[first..]
            .iter()
            .take_while(|(at, _)| *at <= to + bulge);
        window.map(|(_, n)| *n).find(|n| {
            if own.contains(n) {
                return false;
            }
            let x = self.nodes[*n as usize];
            let along = ((x[0] - p[0]) * (q[0] - p[0]) + (x[1] - p[1]) * (q[1] - p[1])) / chord;
            along > near
                && along < chord - near
                && distance(x, line_point(p, middle, q, along / chord)) <= near
        })
    }

    fn hangs(&self, node: u32, element: usize) -> Error {
        let cell = &self.draft.cells[element];
        Error::input(self.place(node), "elements that meet corner to corner")
            .found(format!(
                "a hanging node, within a side of element {} that does not have it as a corner",
                cell.number
            ))
            .hint("mesh both regions with the same divisions of their common line (Gmsh: BooleanFragments or Coherence before meshing; Abaqus: merge the parts, then mesh)")
    }

    fn apart(&self) -> Result<()> {
        let Some((element, count)) = self.sides.apart(self.elements.len()) else {
            return Ok(());
        };
        Err(Error::input(
            self.draft.place_of_cell(element),
            "one part, connected by the sides of its elements",
        )
        .found(format!(
            "{count} of {} elements that nothing connects with element {}",
            self.elements.len(),
            self.draft.cells[0].number
        ))
        .hint(format!("{MERGE}, or delete what is not the specimen")))
    }
}
