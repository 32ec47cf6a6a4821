//! Abaqus' input files (`*.inp`), also as Gmsh and CalculiX write them.
//!
//! Edges are named, in this order of precedence, by surfaces (element sides, or nodes), by element sets of line elements
//! (T2D2, T3D2, T3D3, as Gmsh writes them), and by node sets: a boundary side belongs to a node set when all its nodes do.
//! Regions are named by element sets. Sets that Abaqus marks as internal only serve the surfaces that are made of them.
//! Where a part's set has the name of one of the assembly, it goes by `instance.name`.
//!
//! One part is read, in at most one instance, moved by its translation. Names are found in any case and kept as first written.
//! Sections, materials, steps and all other keywords are passed over. Elements without area (masses, springs, connectors) are left out
//! with a remark. A file that names no edge gets names for the sides of its box.

mod blocks;
mod deck;
mod elements;
mod finish;
mod keyword;
mod sets;

use std::path::Path;

use super::mesh::ImportedMesh;
use crate::error::Result;

/// The mesh in the bytes of a file; included files are read from beside `path`.
///
/// # Errors
/// The input's fault, with file and line: element types that are not plane-stress or shell elements, keywords that make nodes
/// or elements, more than one part or instance, a rotated instance, sets of what is not there, files that include each
/// other, a file that is cut short, and a mesh that is unfit.
pub fn parse(bytes: &[u8], path: &Path) -> Result<ImportedMesh> {
    let mut deck = deck::Deck::default();
    deck.read(bytes, path, 0)?;
    finish::mesh(deck.end()?)
}
