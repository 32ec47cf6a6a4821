//! NASTRAN bulk data (`.bdf`, `.nas`, `.dat`, `.fem`): `GRID`, `CTRIA3`, `CTRIA6`, `CTRIAR`, `CQUAD4`, `CQUAD8` and `CQUADR`, in free, small and
//! large fields.
//!
//! Properties name regions by their numbers. Nothing in bulk data names an edge: the sides of the box get names. Elements along lines
//! and at points are left out with a remark; so is all else that makes no mesh.

mod card;

use std::collections::BTreeMap;
use std::path::Path;

use super::check::leave_out_flat;
use super::draft::{Cell, Draft, DraftNode, Index};
use super::kind::ElementKind;
use super::mesh::ImportedMesh;
use super::shape::NamelessMesh;
use crate::error::{Error, Result};
use card::{BulkCard, cards};

/// What bulk data begin with, after comments and the parts before them.
const MARKS: [&str; 4] = ["GRID", "BEGIN", "CEND", "SOL"];

/// Whether the bytes look like bulk data: Gmsh's sections and NASTRAN's comments both begin with `$`.
pub fn is_bulk_data(bytes: &[u8]) -> bool {
    let mut lines = bytes.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    lines.any(|line| {
        let end = line.iter().position(|b| !b.is_ascii_alphabetic());
        let word = &line[..end.unwrap_or(line.len())];
        MARKS
            .iter()
            .any(|m| word.eq_ignore_ascii_case(m.as_bytes()))
    })
}

/// The mesh in the bytes of a file; `path` is its name for errors.
///
/// # Errors
/// The input's fault, with file and line: solid elements, coordinate systems, numbers that are none, and a mesh that is unfit.
pub fn parse(bytes: &[u8], path: &Path) -> Result<ImportedMesh> {
    let mut bulk = BulkData {
        draft: Draft {
            files: vec![path.to_path_buf()],
            ..Draft::default()
        },
        ..BulkData::default()
    };
    for card in cards(bytes) {
        bulk.card(&card)
            .map_err(|e| e.within(format!("{}:{}", path.display(), card.line)))?;
    }
    bulk.mesh()
}

#[derive(Default)]
struct BulkData {
    draft: Draft,
    /// Indices of the draft's elements by the numbers of their properties.
    properties: BTreeMap<u64, Vec<u32>>,
    /// Whether `ENDDATA` is there.
    is_ended: bool,
    /// How many elements of each name were left out.
    left_out: BTreeMap<String, usize>,
}

/// A card's elements in the plane.
fn plane(name: &str) -> Option<ElementKind> {
    match name {
        "CTRIA3" | "CTRIAR" => Some(ElementKind::T3),
        "CTRIA6" => Some(ElementKind::T6),
        "CQUAD4" | "CQUADR" => Some(ElementKind::Q4),
        "CQUAD8" => Some(ElementKind::Q8),
        _ => None,
    }
}

/// Elements at points and along lines.
const WITHOUT_AREA: [&str; 22] = [
    "CBAR", "CBEAM", "CBEND", "CROD", "CONROD", "CTUBE", "CELAS1", "CELAS2", "CELAS3", "CELAS4",
    "CDAMP1", "CDAMP2", "CMASS1", "CMASS2", "CONM1", "CONM2", "CBUSH", "CGAP", "RBE2", "RBE3",
    "RBAR", "PLOTEL",
];

/// Elements with a volume or about an axis, and cards that place nodes elsewhere.
const REFUSED: [(&str, &str); 9] = [
    ("CTETRA", "solid elements"),
    ("CHEXA", "solid elements"),
    ("CPENTA", "solid elements"),
    ("CPYRAM", "solid elements"),
    ("CTRIAX", "elements about an axis"),
    ("CTRIAX6", "elements about an axis"),
    ("CQUADX", "elements about an axis"),
    ("CQUAD", "elements of up to nine nodes (CQUAD)"),
    ("INCLUDE", "another file"),
];

impl BulkData {
    fn card(&mut self, card: &BulkCard) -> Result<()> {
        let name = card.name.as_str();
        self.is_ended |= name == "ENDDATA";
        if name == "GRID" {
            return self.node(card);
        }
        if let Some(kind) = plane(name) {
            return self.element(card, kind);
        }
        if WITHOUT_AREA.contains(&name) {
            *self.left_out.entry(name.into()).or_default() += 1;
        }
        let refused = REFUSED.iter().find(|(known, _)| *known == name);
        refused.map_or(Ok(()), |(_, what)| {
            Err(
                Error::input(name, "GRID, CTRIA3, CTRIA6, CQUAD4 and CQUAD8")
                    .found(what)
                    .hint("write a mesh of the specimen's middle surface, in one file"),
            )
        })
    }

    fn node(&mut self, card: &BulkCard) -> Result<()> {
        let number = card.number(0, "the number of a node")?;
        let system = card.field(1);
        if !(system.is_empty() || system == "0") {
            return Err(
                Error::input(format!("GRID {number}"), "coordinates in the basic system")
                    .found(format!("those of system {system}"))
                    .hint("write the nodes in the basic coordinate system (field 3 of GRID empty)"),
            );
        }
        let mut at = [0.0; 3];
        for (k, x) in at.iter_mut().enumerate() {
            *x = card.real(2 + k)?;
        }
        let spot = card.spot();
        self.draft.nodes.push(DraftNode { number, at, spot });
        Ok(())
    }

    fn element(&mut self, card: &BulkCard, kind: ElementKind) -> Result<()> {
        let number = card.number(0, "the number of an element")?;
        // a property that is not named has the element's number
        let property = match card.field(1) {
            "" => number,
            _ => card.number(1, "the number of a property")?,
        };
        let mut nodes = [Cell::NONE; 8];
        for (k, node) in nodes.iter_mut().enumerate().take(kind.nodes()) {
            if k >= kind.corners() && ["", "0"].contains(&card.field(2 + k)) {
                return Err(
                    Error::input(format!("{} {number}", card.name), "all midside nodes")
                        .found("one left out")
                        .hint("mesh with elements of one order, all midside nodes there"),
                );
            }
            *node = card.number(2 + k, "the number of a node")?;
        }
        let index = self.draft.cells.len() as u32;
        self.properties.entry(property).or_default().push(index);
        self.draft.cells.push(Cell {
            number,
            kind,
            nodes,
            is_shell: false,
            spot: card.spot(),
        });
        Ok(())
    }

    fn mesh(mut self) -> Result<ImportedMesh> {
        for (name, count) in &self.left_out {
            let file = self.draft.file(0);
            self.draft.remarks.push(format!(
                "{file}: {count} elements {name} are left out: they have no area"
            ));
        }
        if let Err(again) = Index::new(self.draft.cells.iter().map(|c| c.number)) {
            let place = self.draft.place_of_cell(again);
            return Err(Error::input(place, "every element number once")
                .found("a second element of this number"));
        }
        let kept = leave_out_flat(&mut self.draft);
        let mut shape = NamelessMesh::of(self.draft)?;
        if !self.is_ended {
            shape.check_whole()?;
        }
        for (property, members) in &self.properties {
            let members = members.iter().filter_map(|i| kept[*i as usize]);
            shape.name_region(&property.to_string(), members.map(|i| i as usize).collect())?;
        }
        Ok(shape.into_mesh(false))
    }
}
