//! Sides of elements: who shares them, which lie on the boundary, and their order along it.

use super::draft::Draft;
use super::mesh::{BoundaryEdge, Element};
use crate::error::{Error, Result};
use crate::numeric::Forest;

/// What to do about coincident nodes.
pub(super) const MERGE: &str =
    "merge coincident nodes (Gmsh: Coherence Mesh; Abaqus: Tools > merge)";

/// A side by its corners, the smaller index first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct ElementSide {
    corners: [u32; 2],
    element: u32,
    side: u8,
}

impl ElementSide {
    fn edge(&self) -> BoundaryEdge {
        BoundaryEdge {
            element: self.element as usize,
            side: usize::from(self.side),
        }
    }
}

/// All sides of a mesh, those between the same corners together.
#[derive(Debug)]
pub(super) struct ElementSides(Vec<ElementSide>);

/// Who has a side between two nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Owners {
    Nobody,
    /// It lies on the boundary.
    One(BoundaryEdge),
    Two,
}

impl ElementSides {
    /// Of elements that are all counter-clockwise.
    ///
    /// # Errors
    /// The input's fault: a side of three elements, elements on the same side of a side, or other midside nodes.
    pub fn of(draft: &Draft, elements: &[Element]) -> Result<Self> {
        let mut all = Vec::with_capacity(4 * elements.len());
        for (e, element) in (0u32..).zip(elements) {
            for side in 0..element.kind.corners() {
                let [a, b] = element.side(side);
                all.push(ElementSide {
                    corners: [a.min(b), a.max(b)],
                    element: e,
                    side: side as u8,
                });
            }
        }
        all.sort_unstable();
        for group in all.chunk_by(|a, b| a.corners == b.corners) {
            if let [first, second, ..] = group {
                check_shared(draft, elements, [first.edge(), second.edge()], group.len())?;
            }
        }
        Ok(Self(all))
    }

    /// Who has the side between two nodes.
    pub fn owners(&self, a: u32, b: u32) -> Owners {
        let corners = [a.min(b), a.max(b)];
        let from = self.0.partition_point(|s| s.corners < corners);
        let own = |at: usize| self.0.get(at).filter(|s| s.corners == corners);
        match (own(from), own(from + 1)) {
            (None, _) => Owners::Nobody,
            (Some(side), None) => Owners::One(side.edge()),
            _ => Owners::Two,
        }
    }

    /// The boundary, by increasing corners.
    pub fn boundary(&self) -> impl Iterator<Item = BoundaryEdge> + '_ {
        let groups = self.0.chunk_by(|a, b| a.corners == b.corners);
        groups.filter_map(|group| match group {
            [side] => Some(side.edge()),
            _ => None,
        })
    }

    /// An element that no chain of shared sides connects with the first one, and how many there are.
    pub fn apart(&self, elements: usize) -> Option<(usize, usize)> {
        let mut parts = Forest::new(elements);
        for group in self.0.chunk_by(|a, b| a.corners == b.corners) {
            if let [a, b] = group {
                parts.join(a.element, b.element, 0);
            }
        }
        let (root, _) = parts.root(0);
        let mut others = (0..elements as u32).filter(|&e| parts.root(e).0 != root);
        let first = others.next()?;
        Some((first as usize, 1 + others.count()))
    }
}

/// Check the first two elements that have a side.
fn check_shared(
    draft: &Draft,
    elements: &[Element],
    [a, b]: [BoundaryEdge; 2],
    count: usize,
) -> Result<()> {
    let [first, second] = [a, b].map(|s| &elements[s.element]);
    let other = draft.cells[a.element].number;
    if count > 2 || first.side(a.side) == second.side(b.side) {
        return Err(Error::input(
            draft.place_of_cell(b.element),
            "elements that do not overlap",
        )
        .found(format!(
            "a side that element {other} has on the same side of it"
        ))
        .hint("delete the elements that are there twice, or the second surface over the first"));
    }
    if first.midside(a.side) != second.midside(b.side) {
        return Err(Error::input(
            draft.place_of_cell(b.element),
            "one midside node between two elements",
        )
        .found(format!("another one than element {other} has"))
        .hint(MERGE));
    }
    Ok(())
}

/// Put boundary edges in order: each chain from its first corner to its last one, the chain of the lowest element first;
/// a closed one starts at its lowest element.
pub(super) fn in_order(elements: &[Element], mut edges: Vec<BoundaryEdge>) -> Vec<BoundaryEdge> {
    edges.sort_unstable();
    edges.dedup();
    let corners = |edge: &BoundaryEdge| elements[edge.element].side(edge.side);
    let mut starts: Vec<(u32, usize)> = Vec::with_capacity(edges.len());
    starts.extend(edges.iter().enumerate().map(|(i, e)| (corners(e)[0], i)));
    starts.sort_unstable();
    let mut ends: Vec<u32> = edges.iter().map(|e| corners(e)[1]).collect();
    ends.sort_unstable();
    let is_first = |i: usize| ends.binary_search(&corners(&edges[i])[0]).is_err();
    let (open, closed): (Vec<usize>, Vec<usize>) = (0..edges.len()).partition(|&i| is_first(i));
    let mut done = vec![false; edges.len()];
    let mut ordered = Vec::with_capacity(edges.len());
    for first in open.into_iter().chain(closed) {
        let mut next = (!done[first]).then_some(first);
        while let Some(i) = next {
            done[i] = true;
            ordered.push(edges[i]);
            let end = corners(&edges[i])[1];
            let from = starts.partition_point(|(n, _)| *n < end);
            let here = starts[from..].iter().take_while(|(n, _)| *n == end);
            next = here.map(|(_, i)| *i).find(|i| !done[*i]);
        }
    }
    ordered
}
