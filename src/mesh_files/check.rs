//! Checks of a draft that look at one element or one node at a time.

use super::draft::{Cell, Draft, Index};
use super::jacobian;
use super::kind::Kind;
use super::mesh::Element;
use crate::error::{Error, Result};

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
    let name = |kind: Kind| format!("{kind:?}");
    Err(Error::input(
        draft.place_of_cell(at),
        "elements that are all linear (T3, Q4) or all quadratic (T6, Q8)",
    )
    .found(format!(
        "{} where element {} is {}",
        name(draft.cells[at].kind),
        first.number,
        name(first.kind)
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
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &old in kept {
        let at = draft.nodes[old as usize].at;
        if let Some(bad) = at.iter().find(|x| x.abs() > LARGEST || !x.is_finite()) {
            return Err(Error::input(
                draft.place_of_node(old as usize),
                format!("coordinates below {LARGEST:e} mm"),
            )
            .found(bad));
        }
        for k in 0..3 {
            low[k] = low[k].min(at[k]);
            high[k] = high[k].max(at[k]);
        }
    }
    let size = (high[0] - low[0]).max(high[1] - low[1]);
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sense {
    CounterClockwise,
    Clockwise,
    /// No area.
    Flat,
    /// Its Jacobian determinant changes sign.
    Folded,
}

fn sense(element: &Element, nodes: &[[f64; 2]]) -> Sense {
    let mut x = [[0.0; 2]; 8];
    for (x, &n) in x.iter_mut().zip(element.nodes()) {
        *x = nodes[n as usize];
    }
    let count = element.kind.nodes();
    let range = jacobian::range(element.kind, &x[..count]);
    let n = element.kind.corners();
    let side = |k: usize| (x[k][0] - x[(k + 1) % n][0]).hypot(x[k][1] - x[(k + 1) % n][1]);
    let longest = (0..n).map(side).fold(0.0, f64::max);
    let [low, high] = range.inside;
    let zero = THINNEST * longest * longest;
    if low.abs().max(high.abs()) <= zero || longest == 0.0 {
        return Sense::Flat;
    }
    // quarter-point elements at a crack tip have a zero determinant in one corner
    let slack = if element.kind.is_quadratic() {
        zero
    } else {
        0.0
    };
    if low > 0.0 && range.corners[0] >= -slack {
        Sense::CounterClockwise
    } else if high < 0.0 && range.corners[1] <= slack {
        Sense::Clockwise
    } else {
        Sense::Folded
    }
}

/// Turn all elements counter-clockwise if all are clockwise; whether they were.
pub(super) fn orient(draft: &Draft, elements: &mut [Element], nodes: &[[f64; 2]]) -> Result<bool> {
    let senses: Vec<Sense> = elements.iter().map(|e| sense(e, nodes)).collect();
    for (e, sense) in senses.iter().enumerate() {
        let (found, hint) = match sense {
            Sense::Flat => (
                "one without area",
                "delete it, or move the node that lies on the line between its neighbours",
            ),
            Sense::Folded => (
                "one that is folded: a corner of 180 degrees or more, a midside node far off the middle, or nodes in a wrong order",
                "corners go around the element, then the midside nodes in the same order; else mesh finer there",
            ),
            _ => continue,
        };
        return Err(
            Error::input(draft.place_of_cell(e), "an element with an area")
                .found(found)
                .hint(hint),
        );
    }
    let clockwise = senses.iter().filter(|s| **s == Sense::Clockwise).count();
    if clockwise == 0 || clockwise == elements.len() {
        if clockwise > 0 {
            for element in elements {
                *element = element.reversed();
            }
        }
        return Ok(clockwise > 0);
    }
    let (few, name, other) = if 2 * clockwise <= elements.len() {
        (Sense::Clockwise, "clockwise", "counter-clockwise")
    } else {
        (Sense::CounterClockwise, "counter-clockwise", "clockwise")
    };
    let count = clockwise.min(elements.len() - clockwise);
    let at = senses.iter().position(|s| *s == few).unwrap_or(0);
    Err(Error::input(
        draft.place_of_cell(at),
        format!("elements of one orientation, {other} as the other {}", elements.len() - count),
    )
    .found(format!("{count} that are inverted ({name}), this one first"))
    .hint("Gmsh: ReverseMesh Surface{..}, or reverse the surface's curve loop; Abaqus: flip the normals of the region (Assign > Element normal)"))
}
