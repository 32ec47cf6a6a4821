//! Meshes made by other programs: Gmsh's MSH 2.2 and 4.1, Abaqus' input files and NASTRAN's bulk data, read into one checked type.
//!
//! A reader makes a draft in the file's own numbers; the shape is made from it once, with all checks; then the reader names
//! edges and regions. Lengths are in mm.

pub mod abaqus;
mod check;
mod curved;
mod draft;
mod file;
pub mod gmsh;
mod jacobian;
mod kind;
mod mesh;
pub mod nastran;
mod plate;
mod proposed;
mod quads;
mod raise;
mod regions;
mod seams;
mod shape;
mod sides;
mod spec;

use std::path::Path;

use crate::error::{Error, Result};

pub use jacobian::shape_gradient;
pub use kind::ElementKind;
pub use mesh::{BoundaryEdge, Element, ImportedMesh};
pub use plate::{Circle, ImportedPlate, Part};
pub use raise::raise;
pub use regions::RegionSpec;
pub use spec::MeshSpec;

/// Read a mesh file: Gmsh's by its sections, Abaqus' by the name `*.inp` or a first line that begins with `*`, NASTRAN's by its entries.
///
/// # Errors
/// The input's fault: a file that cannot be read, one of another format, and all that [`gmsh::parse`], [`abaqus::parse`] and
/// [`nastran::parse`] refuse.
pub fn read(path: &Path) -> Result<ImportedMesh> {
    let bytes = file::load(path)?;
    let start = bytes.trim_ascii_start();
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let is_gmsh = bytes.windows(11).any(|w| w == b"$MeshFormat");
    if !is_gmsh && !start.starts_with(b"*") && nastran::is_bulk_data(&bytes) {
        nastran::parse(&bytes, path)
    } else if start.starts_with(b"$") {
        gmsh::parse(&bytes, path)
    } else if start.starts_with(b"*") || extension.is_some_and(|e| e == "inp") {
        abaqus::parse(&bytes, path)
    } else {
        Err(
            Error::input(path.display(), "a mesh of Gmsh (.msh), Abaqus (.inp) or NASTRAN (.bdf)")
                .found(first_line(start))
                .hint("Gmsh: File > Export > .msh; Abaqus: write the input file of the job; NASTRAN: bulk data with GRID"),
        )
    }
}

/// What a file of no known format begins with.
fn first_line(start: &[u8]) -> String {
    let line = start.split(|b| *b == b'\n').next().unwrap_or_default();
    match String::from_utf8_lossy(line.trim_ascii()).as_ref() {
        "" => "an empty file".into(),
        line => format!("the first line {line:?}"),
    }
}
