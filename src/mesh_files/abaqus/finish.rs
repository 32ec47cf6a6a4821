//! The mesh of an input file, with edges and regions named by its surfaces and sets.

use super::super::check::leave_out_flat;
use super::super::draft::{Allowance, Draft, FileSpot, Index};
use super::super::mesh::{BoundaryEdge, ImportedMesh};
use super::super::shape::NamelessMesh;
use super::super::sides::Owners;
use super::deck::{Deck, DeckPatch, DeckSurface};
use super::keyword::number;
use super::sets::{DeckSet, SetMember, SetScope, Sets, resolve};
use crate::error::{Error, Result};

/// A file's mesh and groups.
struct FinishedDeck {
    shape: NamelessMesh,
    node_sets: Sets,
    element_sets: Sets,
    /// Members of each node set: the draft's indices.
    nodes: Vec<Vec<u32>>,
    /// Members of each element set: the draft's indices, of lines after those of elements.
    elements: Vec<Vec<u32>>,
    numbers: Index,
    instance: Option<String>,
    allowance: Allowance,
}

/// Check and name.
///
/// # Errors
/// The input's fault: an unfit mesh, sets and surfaces of what is not there.
pub(super) fn mesh(mut deck: Deck) -> Result<ImportedMesh> {
    leave_out_flat(&mut deck.draft);
    let numbers = numbers(&deck.draft)?;
    let shape = NamelessMesh::of(deck.draft)?;
    let draft = shape.draft();
    let mut allowance = Allowance::default();
    let elements = resolve(
        draft,
        &deck.element_sets,
        &numbers,
        ("element", &|_, _| None),
        &mut allowance,
    )?;
    let nodes_of = |name: &str, scope| {
        let at = deck.element_sets.find(name, scope)?;
        let members = elements.get(at)?.iter();
        let numbers = members
            .flat_map(|&i| nodes_of_element(draft, i as usize))
            .copied();
        Some(numbers.filter_map(|n| shape.numbers().get(n)).collect())
    };
    let nodes = resolve(
        draft,
        &deck.node_sets,
        shape.numbers(),
        ("node", &nodes_of),
        &mut allowance,
    )?;
    let mut model = FinishedDeck {
        nodes,
        elements,
        numbers,
        shape,
        node_sets: deck.node_sets,
        element_sets: deck.element_sets,
        instance: deck.instance,
        allowance,
    };
    for surface in deck.surfaces.iter().filter(|s| !s.is_internal) {
        model.name_surface(surface)?;
    }
    model.name_element_sets()?;
    model.name_node_sets()?;
    model.shape.check_whole()?;
    let names_lines = |lines: &Vec<u32>| {
        let cells = model.shape.elements().len();
        lines.iter().any(|i| *i as usize >= cells)
    };
    let names_edges =
        deck.surfaces.iter().any(|s| !s.is_internal) || model.elements.iter().any(names_lines);
    Ok(model.shape.into_mesh(names_edges))
}

/// Numbers of the nodes of an element, or of a line element after them.
fn nodes_of_element(draft: &Draft, i: usize) -> &[u64] {
    let line = || draft.lines.get(i - draft.cells.len()).map(|l| &l.nodes[..]);
    let cell = draft.cells.get(i).map(|c| &c.nodes[..]);
    cell.or_else(line).unwrap_or_default()
}

/// Numbers of elements and line elements, which count together.
fn numbers(draft: &Draft) -> Result<Index> {
    let cells = draft.cells.iter().map(|c| (c.number, c.spot));
    let lines = draft.lines.iter().map(|l| (l.number, l.spot));
    let all: Vec<(u64, FileSpot)> = cells.chain(lines).collect();
    Index::new(all.iter().map(|(n, _)| *n)).map_err(|again| {
        let (number, spot) = all.get(again).copied().unwrap_or_default();
        let place = format!("{}: element {number}", draft.place(spot));
        Error::input(place, "every element number once")
            .found("a second element of this number")
            .hint("renumber the elements of one of the parts that were put together")
    })
}

impl FinishedDeck {
    /// A name as written, or behind the instance's where it would mean two things.
    fn name(&self, sets: &Sets, set: &DeckSet) -> String {
        match &self.instance {
            Some(instance) if set.scope == SetScope::Part && sets.is_ambiguous(&set.name) => {
                format!("{instance}.{}", set.name)
            }
            _ => set.name.clone(),
        }
    }

    fn name_surface(&mut self, surface: &DeckSurface) -> Result<()> {
        let mut edges = Vec::new();
        let mut inside = 0;
        let mut nodes = Vec::new();
        for patch in &surface.patches {
            let draft = self.shape.draft();
            let place = draft.place(patch.spot);
            let size = draft.nodes.len() + draft.cells.len() + draft.lines.len();
            let members = self.members_of(surface, patch, &place)?;
            self.allowance.take(members.len(), size, || place.clone())?;
            if surface.is_of_nodes {
                nodes.extend(members);
                continue;
            }
            let sides = sides(&patch.side, &place)?;
            if sides.is_empty() {
                let text = format!(
                    "{place}: a face of shells in the surface {} is left out: it is no edge",
                    surface.name
                );
                self.shape.remark(text);
            }
            for element in members {
                inside += self.add_sides(element as usize, sides, patch, &mut edges)?;
            }
        }
        if surface.is_of_nodes {
            edges = self.shape.among(&nodes);
        }
        if inside > 0 {
            self.shape.remark(format!(
                "{inside} sides of the surface {} lie inside the mesh and are left out",
                surface.name
            ));
        }
        self.shape.name_edge(&surface.name, edges)
    }

    /// Nodes or elements that a line of a surface names.
    fn members_of(
        &self,
        surface: &DeckSurface,
        patch: &DeckPatch,
        place: &str,
    ) -> Result<Vec<u32>> {
        let (sets, members, index, what) = if surface.is_of_nodes {
            (&self.node_sets, &self.nodes, self.shape.numbers(), "node")
        } else {
            (&self.element_sets, &self.elements, &self.numbers, "element")
        };
        let found = match number(&patch.target) {
            Some(number)
                if !surface.is_of_nodes && self.shape.draft().left_out.contains(&number) =>
            {
                Some(Vec::new())
            }
            Some(number) => index.get(number).map(|i| vec![i]),
            None => {
                let at = sets.find(&patch.target, surface.scope);
                at.and_then(|at| members.get(at)).cloned()
            }
        };
        found.ok_or_else(|| {
            let place = format!("{place}: surface {}", surface.name);
            let expected = format!("the number of an {what} or the name of a set of them");
            Error::input(place, expected.replace("an node", "a node"))
                .found(&patch.target)
                .hint("the set is missing in the file: write it again, or name one that is there")
        })
    }

    /// Add sides of an element that lie on the boundary; how many named ones lie inside.
    fn add_sides(
        &self,
        element: usize,
        sides: &[usize],
        patch: &DeckPatch,
        edges: &mut Vec<BoundaryEdge>,
    ) -> Result<usize> {
        let mut inside = 0;
        let draft = self.shape.draft();
        let Some(cell) = draft.cells.get(element) else {
            return Ok(inside);
        };
        let is_named = sides.len() == 1;
        if is_named && cell.is_shell && patch.side.starts_with('S') {
            let place = draft.place(patch.spot);
            let expected = format!("E1 to E4 for an edge of the shell {}", cell.number);
            return Err(Error::input(place, expected).found(&patch.side).hint(
                "CalculiX counts the edges of shells from S3, Abaqus has E1 to E4: use these, a set of the edge's nodes, or CPS elements",
            ));
        }
        for &side in sides {
            match self.shape.side(element, side) {
                Owners::One(edge) => edges.push(edge),
                Owners::Two if is_named => inside += 1,
                Owners::Nobody if is_named => {
                    let place = draft.place(patch.spot);
                    let expected = format!("a side that element {} has", cell.number);
                    return Err(Error::input(place, expected).found(&patch.side));
                }
                _ => {}
            }
        }
        Ok(inside)
    }

    /// Sets of elements name regions, sets of line elements edges.
    fn name_element_sets(&mut self) -> Result<()> {
        let count = self.shape.elements().len();
        for (set, members) in self.element_sets.all.iter().zip(&self.elements) {
            if set.is_internal {
                continue;
            }
            let name = self.name(&self.element_sets, set);
            let (plane, lines): (Vec<usize>, Vec<usize>) = members
                .iter()
                .map(|i| *i as usize)
                .partition(|i| *i < count);
            self.shape.name_region(&name, plane)?;
            if lines.is_empty() {
                continue;
            }
            let lines: Vec<u32> = lines.iter().map(|i| (i - count) as u32).collect();
            let (edges, inside) = self.shape.along_lines(&name, &lines)?;
            if inside > 0 {
                let text = format!(
                    "{inside} of {} line elements of the set {name} lie inside the mesh and are left out",
                    lines.len()
                );
                self.shape.remark(text);
            }
            add_edge(&mut self.shape, &name, edges, "element set")?;
        }
        Ok(())
    }

    fn name_node_sets(&mut self) -> Result<()> {
        for (set, members) in self.node_sets.all.iter().zip(&self.nodes) {
            if set.is_internal {
                continue;
            }
            let name = self.name(&self.node_sets, set);
            let edges = self.shape.among(members);
            let is_of_cells = |(member, _): &(SetMember, FileSpot)| match member {
                SetMember::NodesOf(name) => {
                    let at = self.element_sets.find(name, set.scope);
                    let all = at
                        .and_then(|at| self.elements.get(at))
                        .into_iter()
                        .flatten();
                    all.into_iter()
                        .any(|i| (*i as usize) < self.shape.elements().len())
                }
                _ => false,
            };
            if !edges.is_empty() && set.members.iter().any(is_of_cells) {
                self.shape.remark(format!(
                    "the node set {name} has all nodes of elements: as an edge it goes along all their sides on the boundary"
                ));
            }
            if edges.is_empty() && members.len() > 1 && self.shape.edge(&name).is_empty() {
                self.shape.remark(format!(
                    "the node set {name} has all nodes of no side on the boundary: it names no edge"
                ));
            }
            add_edge(&mut self.shape, &name, edges, "node set")?;
        }
        Ok(())
    }
}

/// Name an edge, unless what takes precedence has the name.
fn add_edge(
    shape: &mut NamelessMesh,
    name: &str,
    edges: Vec<BoundaryEdge>,
    what: &str,
) -> Result<()> {
    let mut known = shape.edge(name).to_vec();
    if known.is_empty() {
        return shape.name_edge(name, edges);
    }
    let mut edges = edges;
    known.sort_unstable();
    edges.sort_unstable();
    edges.dedup();
    if known != edges && !edges.is_empty() {
        shape.remark(format!(
            "the {what} {name} is left out as an edge: a surface or set of line elements of this name is another one"
        ));
    }
    Ok(())
}

/// The sides that the second field of a surface's line means, from 0: one, all for an empty field, none for a face of a shell.
fn sides(field: &str, place: &str) -> Result<&'static [usize]> {
    const ALL: [usize; 4] = [0, 1, 2, 3];
    match field {
        "" => Ok(&ALL),
        "S1" | "E1" => Ok(&ALL[0..1]),
        "S2" | "E2" => Ok(&ALL[1..2]),
        "S3" | "E3" => Ok(&ALL[2..3]),
        "S4" | "E4" => Ok(&ALL[3..4]),
        "SPOS" | "SNEG" => Ok(&[]),
        other => Err(
            Error::input(place, "a side of elements: S1 to S4 (E1 to E4 for shells)").found(other),
        ),
    }
}
