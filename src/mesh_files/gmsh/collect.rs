//! Elements and physical groups of an MSH file, and what they name.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;

use super::super::check::leave_out_flat;
use super::super::draft::{Allowance, Cell, Draft, DraftLine, FileSpot, Index};
use super::super::kind::ElementKind;
use super::super::mesh::ImportedMesh;
use super::super::shape::NamelessMesh;
use super::source::MeshText;
use crate::error::{Error, Result};

/// What an element type of Gmsh is here.
#[derive(Debug, Clone, Copy)]
pub(super) enum EntityShape {
    Point,
    /// Of two or three nodes.
    Line(usize),
    Plane(ElementKind),
    /// Nine nodes, of which the last, in the middle, is dropped.
    Nine,
}

impl EntityShape {
    /// Number of nodes in the file.
    pub fn nodes(self) -> usize {
        match self {
            EntityShape::Point => 1,
            EntityShape::Line(nodes) => nodes,
            EntityShape::Plane(kind) => kind.nodes(),
            EntityShape::Nine => 9,
        }
    }
}

/// The shape of an element type; `whose` says of which element or block.
///
/// # Errors
/// The input's fault: an element in space, of order 3 or more, or of an unknown type.
pub(super) fn shape(
    source: &MeshText<'_>,
    gmsh_type: i64,
    whose: impl Display,
) -> Result<EntityShape> {
    let expected =
        "T3, Q4, T6, Q8 or Q9 elements (types 2, 3, 9, 16, 10), lines (1, 8) or points (15)";
    let (what, hint) = match gmsh_type {
        15 => return Ok(EntityShape::Point),
        1 => return Ok(EntityShape::Line(2)),
        8 => return Ok(EntityShape::Line(3)),
        2 => return Ok(EntityShape::Plane(ElementKind::T3)),
        3 => return Ok(EntityShape::Plane(ElementKind::Q4)),
        9 => return Ok(EntityShape::Plane(ElementKind::T6)),
        16 => return Ok(EntityShape::Plane(ElementKind::Q8)),
        10 => return Ok(EntityShape::Nine),
        4..=7 | 11..=14 | 17..=19 | 29..=33 | 71..=75 | 79..=83 | 90..=123 => (
            "three-dimensional",
            "Gmsh: mesh in two dimensions (Mesh > 2D) and save only the surface's physical groups",
        ),
        20..=28 | 36..=70 => (
            "of an order above 2 or incomplete",
            "Gmsh: Mesh > Set order 2, or Mesh.ElementOrder = 2",
        ),
        _ => (
            "unknown",
            "the file is damaged, or of a program that Gmsh does not read",
        ),
    };
    Err(
        Error::input(format!("{}: {whose}", source.place()), expected)
            .found(format!("type {gmsh_type}, which is {what}"))
            .hint(hint),
    )
}

/// A physical group: its dimension, 1 or 2, and its number.
type PhysicalGroup = (u8, u64);

/// What the sections of a file add up to.
#[derive(Default)]
pub(super) struct Collector {
    pub draft: Draft,
    names: HashMap<PhysicalGroup, String>,
    /// (dimension, number, physical group) of entities, sorted once they are complete.
    entities: Vec<(i64, i64, i64)>,
    /// Indices of the draft's lines and elements.
    groups: BTreeMap<PhysicalGroup, Vec<u32>>,
    allowance: Allowance,
    /// An entity in several groups is written several times by version 2.2: elements by their nodes.
    cells: HashMap<[u64; 8], u32>,
    lines: HashMap<[u64; 3], u32>,
}

impl Collector {
    /// The name of a physical group.
    pub fn name(&mut self, dimension: u8, tag: i64, name: &str) {
        if !name.is_empty() {
            self.names
                .insert((dimension, tag.unsigned_abs()), name.to_string());
        }
    }

    /// A physical group of an entity; a negative one is run through in the other sense.
    pub fn entity(&mut self, dimension: i64, tag: i64, group: i64) {
        self.entities.push((dimension, tag, group));
    }

    /// To be called when all entities are there.
    pub fn sort_entities(&mut self) {
        self.entities.sort_unstable();
        self.entities.dedup();
    }

    /// The physical groups of an entity.
    pub fn groups_of(&self, dimension: i64, tag: i64) -> Vec<i64> {
        let from = self
            .entities
            .partition_point(|(d, t, _)| (*d, *t) < (dimension, tag));
        let own = self.entities[from..].iter();
        let own = own.take_while(|(d, t, _)| (*d, *t) == (dimension, tag));
        own.map(|(_, _, group)| *group).collect()
    }

    /// An element of the file in some physical groups.
    ///
    /// # Errors
    /// The input's fault if the groups have too many members.
    pub fn element(
        &mut self,
        number: u64,
        shape: EntityShape,
        nodes: [u64; 9],
        spot: FileSpot,
        groups: &[i64],
    ) -> Result<()> {
        let (dimension, index) = match shape {
            EntityShape::Point => return Ok(()),
            EntityShape::Line(_) => {
                let nodes = [nodes[0], nodes[1], nodes[2]];
                let lines = &mut self.draft.lines;
                let index = *self.lines.entry(nodes).or_insert_with(|| {
                    lines.push(DraftLine {
                        number,
                        nodes,
                        spot,
                    });
                    (lines.len() - 1) as u32
                });
                (1, index)
            }
            EntityShape::Plane(_) | EntityShape::Nine => {
                let kind = match shape {
                    EntityShape::Plane(kind) => kind,
                    _ => ElementKind::Q8,
                };
                let nodes = std::array::from_fn(|k| nodes[k]);
                let cells = &mut self.draft.cells;
                let index = *self.cells.entry(nodes).or_insert_with(|| {
                    cells.push(Cell {
                        number,
                        kind,
                        nodes,
                        is_shell: false,
                        spot,
                    });
                    (cells.len() - 1) as u32
                });
                (2, index)
            }
        };
        let size = self.draft.cells.len() + self.draft.lines.len();
        let file = || self.draft.file(0);
        self.allowance.take(groups.len(), size, file)?;
        for group in groups {
            let members = self.groups.entry((dimension, group.unsigned_abs()));
            members.or_default().push(index);
        }
        Ok(())
    }

    fn label(&self, group: PhysicalGroup) -> String {
        let name = self.names.get(&group);
        name.cloned().unwrap_or_else(|| group.1.to_string())
    }

    /// The mesh with its names.
    ///
    /// # Errors
    /// The input's fault: an unfit mesh, element numbers that are there twice, physical groups without elements.
    pub fn finish(mut self) -> Result<ImportedMesh> {
        self.check_numbers()?;
        let kept = leave_out_flat(&mut self.draft);
        let mut groups = std::mem::take(&mut self.groups);
        for (group, members) in &mut groups {
            if group.0 == 2 {
                *members = members.iter().filter_map(|i| kept[*i as usize]).collect();
            }
        }
        let labels: Vec<String> = groups.keys().map(|g| self.label(*g)).collect();
        let empty = self.names.iter().filter(|(g, _)| (1..=2).contains(&g.0));
        let empty = empty.filter(|(g, _)| !groups.contains_key(g));
        let mut empty: Vec<&String> = empty.map(|(_, name)| name).collect();
        empty.sort_unstable();
        let remark = |name: &String| format!("the physical group {name:?} holds no elements");
        self.draft.remarks.extend(empty.into_iter().map(remark));
        let mut shape = NamelessMesh::of(self.draft)?;
        if groups.is_empty() && !self.names.is_empty() {
            return Err(lost_groups(&shape.draft().file(0)));
        }
        let names_edges = groups.keys().any(|group| group.0 == 1);
        for ((group, members), label) in groups.iter().zip(labels) {
            if group.0 == 2 {
                shape.name_region(&label, members.iter().map(|i| *i as usize).collect())?;
                continue;
            }
            let (edges, inside) = shape.along_lines(&label, members)?;
            if inside > 0 {
                shape.remark(format!(
                    "{inside} of {} lines of the physical group {label:?} lie inside the mesh and are left out",
                    members.len()
                ));
            }
            shape.name_edge(&label, edges)?;
        }
        Ok(shape.into_mesh(names_edges))
    }

    /// Two elements of one number but other nodes.
    fn check_numbers(&self) -> Result<()> {
        let cells = self.draft.cells.iter().map(|c| c.number);
        match Index::new(cells) {
            Ok(_) => Ok(()),
            Err(again) => Err(Error::input(
                self.draft.place_of_cell(again),
                "every element number once",
            )
            .found("a second element of this number")
            .hint("Gmsh: Mesh > Renumber, or save again with Mesh.SaveAll = 0")),
        }
    }
}

fn lost_groups(file: &str) -> Error {
    Error::input(file, "physical groups that name edges and regions")
        .found("names of groups, but no elements in them")
        .hint("Gmsh: version 2.2 loses the groups if all elements are saved: set Mesh.SaveAll = 0 or save as version 4.1")
}
