//! Checks of a draft that look at one element or one node at a time.

use super::draft::{Cell, Draft, Index};
use super::jacobian;
use super::kind::ElementKind;
use super::mesh::Element;
use crate::error::{Error, Result};
use crate::numeric::range;

/// Coordinates larger than this, mm, are not those of a specimen, and their squares would lose what is small.
const LARGEST: f64 = 1e9;

/// How far nodes may lie off one plane, over the size of the mesh.
const FLATNESS: f64 = 1e-6;

/// A Jacobian determinant below this fraction of the longest side squared counts as zero.
const THINNEST: f64 = 1e-10;

/// Refuse a mesh without elements, and one of linear and quadratic elements.
pub(super) fn orders(draft: &Draft) -> Result<()> {
    let Some(first) = draft.cells.first() else {
        let expected = "elements of a plane mesh: triangles or quadrilaterals";
        let found = match (draft.nodes.len(), draft.lines.len()) {
            (0, _) => "an empty mesh",
            (_, 0) => "only nodes",
            _ => "only nodes and lines",
        };
        return Err(Error::input(draft.file(0), expected).found(found).hint(
            "Gmsh: mesh the surface (Mesh > 2D) and put it into a physical group, since ungrouped elements are not saved; \
             Abaqus: mesh the part; or the file is cut short",
        ));
    };
    let quadratic = first.kind.is_quadratic();
    let other = |cell: &Cell| cell.kind.is_quadratic() != quadratic;
    let Some(at) = draft.cells.iter().position(other) else {
        return Ok(());
    };
    Err(Error::input(
        draft.place_of_cell(at),
        "elements that are all linear (T3, Q4) or all quadratic (T6, Q8)",
    )
    .found(format!(
        "{:?} where element {} is {:?}",
        draft.cells[at].kind, first.number, first.kind
    ))
    .hint("Gmsh: Mesh > Set order 2 for the whole mesh; Abaqus: assign one order to all regions (Mesh > Element type)"))
}

/// The elements by indices of the draft's nodes.
pub(super) fn connectivity(draft: &Draft) -> Result<Vec<Element>> {
    let index = Index::new(draft.nodes.iter().map(|n| n.number)).map_err(|again| {
        Error::input(draft.place_of_node(again), "every node number once")
            .found("a second node of this number")
            .hint("renumber one of the parts that were put together")
    })?;
    let mut elements = Vec::with_capacity(draft.cells.len());
    for (e, cell) in draft.cells.iter().enumerate() {
        let mut all = [Element::NONE; 8];
        for (slot, &number) in all.iter_mut().zip(cell.nodes()) {
            *slot = index.get(number).ok_or_else(|| {
                Error::input(draft.place_of_cell(e), "nodes that the file defines")
                    .found(format!("node {number}, which it does not"))
                    .hint("the file is cut short or the node was deleted: write the mesh again")
            })?;
        }
        let kind = cell.kind;
        let mut sorted = all;
        sorted[..kind.nodes()].sort_unstable();
        if sorted[..kind.nodes()].windows(2).any(|w| w[0] == w[1]) {
            return Err(Error::input(
                draft.place_of_cell(e),
                format!("{} different nodes", kind.nodes()),
            )
            .found("one of them twice")
            .hint("replace collapsed quadrilaterals by triangles"));
        }
        elements.push(Element { kind, all });
    }
    Ok(elements)
}

/// Keep the nodes that elements use, in their order, and number the elements' nodes anew. Returns the draft's index of
/// every node that is kept.
pub(super) fn used(elements: &mut [Element], nodes: usize) -> Vec<u32> {
    let mut new = vec![Element::NONE; nodes];
    for element in elements.iter() {
        for &n in element.nodes() {
            new[n as usize] = 0;
        }
    }
    let mut kept = Vec::new();
    for (old, new) in (0u32..).zip(new.iter_mut()) {
        if *new == 0 {
            *new = kept.len() as u32;
            kept.push(old);
        }
    }
    for element in elements {
        let count = element.kind.nodes();
        for n in &mut element.all[..count] {
            *n = new[*n as usize];
        }
    }
    kept
}

/// Coordinates in the plane of the nodes that are kept.
pub(super) fn flat(draft: &Draft, kept: &[u32]) -> Result<Vec<[f64; 2]>> {
    for &old in kept {
        let at = draft.nodes[old as usize].at;
        if let Some(bad) = at.iter().find(|x| x.abs() > LARGEST || !x.is_finite()) {
            return Err(Error::input(
                draft.place_of_node(old as usize),
                format!("coordinates below {LARGEST:e} mm"),
            )
            .found(bad));
        }
    }
    let extent = |axis: usize| {
        let along = kept.iter().map(|&n| draft.nodes[n as usize].at[axis]);
        let [low, high] = range(along);
        high - low
    };
    let size = extent(0).max(extent(1));
    let plane = kept.first().map_or(0.0, |&n| draft.nodes[n as usize].at[2]);
    for &old in kept {
        let z = draft.nodes[old as usize].at[2];
        if (z - plane).abs() > FLATNESS * size {
            return Err(Error::input(
                draft.place_of_node(old as usize),
                format!("a flat mesh, in x and y at one z: {plane}"),
            )
            .found(format!("z = {z}"))
            .hint(
                "draw the specimen in the x-y plane and mesh its middle surface in two dimensions",
            ));
        }
    }
    let plane = |&old: &u32| {
        let at = draft.nodes[old as usize].at;
        [at[0], at[1]]
    };
    Ok(kept.iter().map(plane).collect())
}

/// The sense in which an element is run through.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sense {
    CounterClockwise,
    Clockwise,
    /// No area.
    Flat,
    /// Its Jacobian determinant changes sign.
    Folded,
}

fn sense(kind: ElementKind, x: &[[f64; 2]]) -> Sense {
    let range = jacobian::range(kind, x);
    let n = kind.corners();
    let side = |k: usize| (x[k][0] - x[(k + 1) % n][0]).hypot(x[k][1] - x[(k + 1) % n][1]);
    let longest = (0..n).map(side).fold(0.0, f64::max);
    let [low, high] = range.inside;
    let zero = THINNEST * longest * longest;
    if low.abs().max(high.abs()) <= zero || longest == 0.0 {
        return Sense::Flat;
    }
    // quarter-point elements at a crack tip have a zero determinant in one corner
    let slack = if kind.is_quadratic() { zero } else { 0.0 };
    if low > 0.0 && range.corners[0] >= -slack {
        Sense::CounterClockwise
    } else if high < 0.0 && range.corners[1] <= slack {
        Sense::Clockwise
    } else {
        Sense::Folded
    }
}

/// Take elements without area out of a draft, and say so. Returns the new index of every element, none for one that is left out.
/// If all are without, the mesh stands across the x-y plane, and is left as it is.
pub(super) fn leave_out_flat(draft: &mut Draft) -> Vec<Option<u32>> {
    let flat = flat_cells(draft).unwrap_or_default();
    let count = flat.iter().filter(|f| **f).count();
    let mut next = 0u32;
    if count == 0 || count == draft.cells.len() {
        return (0..draft.cells.len() as u32).map(Some).collect();
    }
    let first = flat.iter().position(|f| *f).unwrap_or(0);
    let place = draft.place_of_cell(first);
    draft.remarks.push(format!(
        "elements without area are left out, {count} in all, {place} first"
    ));
    let mut index = Vec::with_capacity(flat.len());
    for (cell, is_flat) in draft.cells.iter().zip(&flat) {
        index.push((!is_flat).then_some(next));
        match is_flat {
            true => drop(draft.left_out.insert(cell.number)),
            false => next += 1,
        }
    }
    let mut flat = flat.into_iter();
    draft.cells.retain(|_| flat.next() == Some(false));
    index
}

/// Which elements have no area, if every node is there once.
fn flat_cells(draft: &Draft) -> Option<Vec<bool>> {
    let index = Index::new(draft.nodes.iter().map(|n| n.number)).ok()?;
    let is_flat = |cell: &Cell| {
        let mut x = [[0.0; 2]; 8];
        for (x, &number) in x.iter_mut().zip(cell.nodes()) {
            let at = draft.nodes[index.get(number)? as usize].at;
            if at.iter().any(|c| c.abs() > LARGEST || !c.is_finite()) {
                // a node that is nowhere is another error
                return Some(false);
            }
            *x = [at[0], at[1]];
        }
        Some(sense(cell.kind, &x[..cell.kind.nodes()]) == Sense::Flat)
    };
    draft.cells.iter().map(is_flat).collect()
}

/// Turn clockwise elements counter-clockwise; whether each was turned.
pub(super) fn orient(
    draft: &mut Draft,
    elements: &mut [Element],
    nodes: &[[f64; 2]],
) -> Result<Vec<bool>> {
    let mut turned = Vec::with_capacity(elements.len());
    for (e, element) in elements.iter_mut().enumerate() {
        let mut x = [[0.0; 2]; 8];
        for (x, &n) in x.iter_mut().zip(element.nodes()) {
            *x = nodes[n as usize];
        }
        let sense = sense(element.kind, &x[..element.kind.nodes()]);
        let (found, hint) = match sense {
            Sense::Flat => (
                "one without area",
                "delete it, or move the node that lies on the line between its neighbours",
            ),
            Sense::Folded => (
                "one that is folded: a corner of 180 degrees or more, a midside node far off the middle, or nodes in a wrong order",
                "corners go around the element, then the midside nodes in the same order; else mesh finer there",
            ),
            Sense::Clockwise | Sense::CounterClockwise => {
                turned.push(sense == Sense::Clockwise);
                if sense == Sense::Clockwise {
                    *element = element.reversed();
                }
                continue;
            }
        };
        return Err(
            Error::input(draft.place_of_cell(e), "an element with an area")
                .found(found)
                .hint(hint),
        );
    }
    let count = turned.iter().filter(|t| **t).count();
    if count > 0 && count < turned.len() {
        let first = turned.iter().position(|t| *t).unwrap_or(0);
        let place = draft.place_of_cell(first);
        draft.remarks.push(format!(
            "{count} of {} elements run clockwise and are turned, {place} first",
            turned.len()
        ));
    }
    Ok(turned)
}
