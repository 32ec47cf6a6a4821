//! Meshes made by other programs: Gmsh's MSH 2.2 and 4.1 and Abaqus' input files, read into one checked type.
//!
//! A reader makes a draft in the file's own numbers; the shape is made from it once, with all checks; then the reader names
//! edges and regions. Lengths are in mm.

pub mod abaqus;
mod check;
mod draft;
mod file;
pub mod gmsh;
mod jacobian;
mod kind;
mod mesh;
mod plate;
mod quads;
mod raise;
mod regions;
mod seams;
mod shape;
mod sides;
mod spec;

use std::path::Path;

use crate::error::{Error, Result};

pub use kind::Kind;
pub use mesh::{BoundaryEdge, Element, ImportedMesh};
pub use plate::{Circle, ImportedPlate, Part};
pub use raise::raise;
pub use regions::RegionSpec;
pub use spec::{HeldEdge, LoadedEdge, MeshAxis, MeshSpec, OneOrMany, Spread};

/// Read a mesh file: Gmsh's by its first line, Abaqus' by the name `*.inp` or a first line that begins with `*`.
///
/// # Errors
/// The input's fault: a file that cannot be read, one of another format, and all that [`gmsh::parse`] and
/// [`abaqus::parse`] refuse.
pub fn read(path: &Path) -> Result<ImportedMesh> {
    let bytes = file::load(path)?;
    let start = bytes.trim_ascii_start();
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    if start.starts_with(b"$") {
        gmsh::parse(&bytes, path)
    } else if start.starts_with(b"*") || extension.is_some_and(|e| e == "inp") {
        abaqus::parse(&bytes, path)
    } else {
        Err(
            Error::input(path.display(), "a mesh of Gmsh (.msh) or Abaqus (.inp)")
                .found("neither's first line")
                .hint("Gmsh: File > Export > .msh; Abaqus: write the input file of the job"),
        )
    }
}
