//! The checked mesh of a draft, and how a reader names its edges and regions.

use super::check;
use super::draft::{Allowance, Draft, Index};
use super::mesh::{BoundaryEdge, Element, ImportedMesh};
use super::proposed::proposed;
use super::seams::SeamParts;
use super::sides::{ElementSides, Owners, in_order};
use crate::error::{Error, Result};

/// A checked mesh whose edges and regions are not named yet.
pub(super) struct NamelessMesh {
    draft: Draft,
    mesh: ImportedMesh,
    sides: ElementSides,
    /// Whether each element is clockwise in the file.
    turned: Vec<bool>,
    /// The mesh's index of every node of the draft, [`Element::NONE`] for one that no element uses.
    index: Vec<u32>,
    numbers: Index,
    /// The boundary edge that starts at each node: (corner, edge), by corner.
    boundary: Vec<(u32, BoundaryEdge)>,
    allowance: Allowance,
}

impl NamelessMesh {
    /// Check a draft.
    ///
    /// # Errors
    /// The input's fault: whatever makes the mesh unfit for a plane analysis.
    pub fn of(mut draft: Draft) -> Result<Self> {
        check::orders(&draft)?;
        let mut elements = check::connectivity(&draft)?;
        let kept = check::used(&mut elements, draft.nodes.len());
        let nodes = check::flat(&draft, &kept)?;
        let turned = check::orient(&mut draft, &mut elements, &nodes)?;
        let sides = ElementSides::of(&draft, &elements)?;
        SeamParts {
            draft: &draft,
            kept: &kept,
            nodes: &nodes,
            elements: &elements,
            sides: &sides,
        }
        .check()?;
        let numbers = Index::new(draft.nodes.iter().map(|n| n.number)).unwrap_or_default();
        let mut index = vec![Element::NONE; draft.nodes.len()];
        for (new, &old) in (0u32..).zip(&kept) {
            index[old as usize] = new;
        }
        let corner = |edge: BoundaryEdge| elements[edge.element].side(edge.side)[0];
        let mut boundary: Vec<_> = sides.boundary().map(|edge| (corner(edge), edge)).collect();
        boundary.sort_unstable();
        let mesh = ImportedMesh {
            nodes,
            elements,
            files: draft.files.clone(),
            remarks: draft.remarks.clone(),
            ..ImportedMesh::default()
        };
        Ok(Self {
            draft,
            mesh,
            sides,
            turned,
            index,
            numbers,
            boundary,
            allowance: Allowance::default(),
        })
    }

    /// What the file says.
    pub fn draft(&self) -> &Draft {
        &self.draft
    }

    /// The elements, in the order of the draft's.
    pub fn elements(&self) -> &[Element] {
        &self.mesh.elements
    }

    /// The file's numbers of all nodes, used or not, with the draft's indices.
    pub fn numbers(&self) -> &Index {
        &self.numbers
    }

    /// A file that names nothing and has nodes which no element has may be cut short.
    ///
    /// # Errors
    /// The input's fault.
    pub fn check_whole(&self) -> Result<()> {
        let unused = self.index.iter().filter(|n| **n == Element::NONE).count();
        if unused == 0 || !(self.mesh.edges.is_empty() && self.mesh.regions.is_empty()) {
            return Ok(());
        }
        let file = self.draft.file(0);
        Err(Error::input(file, "elements that have all nodes, or names of edges")
            .found(format!("{unused} nodes that no element has, and no names"))
            .hint("the file is cut short: write it again; or delete these nodes; or name the edges"))
    }

    /// Say something about what is left out.
    pub fn remark(&mut self, text: String) {
        self.mesh.remarks.push(text);
    }

    /// The named edge; of nothing if there is none of this name.
    pub fn edge(&self, name: &str) -> &[BoundaryEdge] {
        self.mesh.edges.get(name).map_or(&[], Vec::as_slice)
    }

    /// Put edges in order and give them a name, beside those that have it already.
    ///
    /// # Errors
    /// The input's fault if the groups of the file have too many members.
    pub fn name_edge(&mut self, name: &str, edges: Vec<BoundaryEdge>) -> Result<()> {
        self.count(edges.len(), name)?;
        if edges.is_empty() {
            return Ok(());
        }
        let named = self.mesh.edges.entry(name.to_string()).or_default();
        let mut all = std::mem::take(named);
        all.extend(edges);
        *named = in_order(&self.mesh.elements, all);
        Ok(())
    }

    /// Name a region by its elements' indices.
    ///
    /// # Errors
    /// The input's fault if the groups of the file have too many members.
    pub fn name_region(&mut self, name: &str, elements: Vec<usize>) -> Result<()> {
        self.count(elements.len(), name)?;
        if elements.is_empty() {
            return Ok(());
        }
        let region = self.mesh.regions.entry(name.to_string()).or_default();
        region.extend(elements);
        region.sort_unstable();
        region.dedup();
        Ok(())
    }

    fn count(&mut self, members: usize, name: &str) -> Result<()> {
        let size = self.draft.nodes.len() + self.draft.cells.len() + self.draft.lines.len();
        let file = || format!("{}: {name}", self.draft.file(0));
        self.allowance.take(1 + members, size, file)
    }

    /// Boundary edges along line elements of the draft, and how many of these lie inside.
    ///
    /// # Errors
    /// The input's fault, for a line that is no element's side.
    pub fn along_lines(&self, name: &str, lines: &[u32]) -> Result<(Vec<BoundaryEdge>, usize)> {
        let mut edges = Vec::with_capacity(lines.len());
        let mut inside = 0;
        for &line in lines {
            let line = &self.draft.lines[line as usize];
            // Abaqus and Gmsh put the midside node of a line at different places: only corners make a side
            let [a, b, c] = line.nodes.map(|n| self.node(n));
            let owners = [(a, b), (a, c), (c, b)].map(|pair| match pair {
                (Some(a), Some(b)) => self.sides.owners(a, b),
                _ => Owners::Nobody,
            });
            match owners.into_iter().find(|o| *o != Owners::Nobody) {
                Some(Owners::One(edge)) => edges.push(edge),
                Some(_) => inside += 1,
                None => {
                    let place = self.draft.place(line.spot);
                    return Err(Error::input(
                        format!("{place}: line element {}", line.number),
                        "a line along the side of an element",
                    )
                    .found(format!("one of {name:?} that no element has as a side"))
                    .hint("the surface beside this line is missing: put it into a physical group too, and mesh again"));
                }
            }
        }
        Ok((edges, inside))
    }

    /// The mesh's index of a node by the file's number.
    fn node(&self, number: u64) -> Option<u32> {
        let old = self.numbers.get(number)?;
        Some(self.index[old as usize]).filter(|n| *n != Element::NONE)
    }

    /// Boundary edges all of whose nodes are among these of the draft.
    pub fn among(&self, nodes: &[u32]) -> Vec<BoundaryEdge> {
        let used = nodes.iter().map(|n| self.index[*n as usize]);
        let mut members: Vec<u32> = used.filter(|n| *n != Element::NONE).collect();
        members.sort_unstable();
        let has = |n: u32| members.binary_search(&n).is_ok();
        let starting = |corner: u32| {
            let from = self.boundary.partition_point(|(n, _)| *n < corner);
            self.boundary[from..]
                .iter()
                .take_while(move |(n, _)| *n == corner)
        };
        let edges = members
            .iter()
            .flat_map(|&n| starting(n))
            .map(|(_, edge)| *edge);
        edges
            .filter(|edge| {
                let (_, middle, end) = self.mesh.edge_nodes(*edge);
                has(end) && middle.is_none_or(has)
            })
            .collect()
    }

    /// The side of an element by the file's count from 0: on the boundary or not; nobody's if it has none of this number.
    pub fn side(&self, element: usize, side: usize) -> Owners {
        let turned = self.turned[element];
        let element = &self.mesh.elements[element];
        let n = element.kind.corners();
        if side >= n {
            return Owners::Nobody;
        }
        let [a, b] = element.side(if turned { n - 1 - side } else { side });
        self.sides.owners(a, b)
    }

    /// The mesh. If its file has nothing that names an edge, the sides get names here.
    pub fn into_mesh(mut self, names_edges: bool) -> ImportedMesh {
        if !names_edges && self.mesh.edges.is_empty() {
            let edges = in_order(&self.mesh.elements, self.sides.boundary().collect());
            self.mesh.edges = proposed(&self.mesh, &edges);
            let names: Vec<&str> = self.mesh.edges.keys().map(String::as_str).collect();
            let remark = format!(
                "the file names no edge; the sides of the box and the corners between them make {}",
                names.join(", ")
            );
            self.mesh.remarks.push(remark);
        }
        self.mesh
    }
}
