//! Gmsh's MSH files of versions 2.2 and 4.1, ASCII and binary (little-endian).
//!
//! Physical groups of curves name edges, those of surfaces name regions; a group without a name goes by its number. An
//! entity may be in several groups. A group of points names nothing. Lines inside the mesh are left out of their edge, with
//! a remark. A file without groups of lines gets names for the sides of its box. Nine-node quadrilaterals lose their middle node and become Q8.

mod collect;
mod source;
mod v2;
mod v4;

use std::path::Path;

use super::mesh::ImportedMesh;
use crate::error::Result;
use collect::Collector;
use source::MeshText;

/// The mesh in the bytes of a file; `path` is its name for errors.
///
/// # Errors
/// The input's fault, with file and line (or byte): another version or byte order, a section that is cut short, elements
/// that are not plane or of another order than 1 or 2, and a mesh that is unfit.
pub fn parse(bytes: &[u8], path: &Path) -> Result<ImportedMesh> {
    let mut source = MeshText::new(bytes, path.display().to_string());
    let version = format(&mut source)?;
    let mut collector = Collector::default();
    collector.draft.files.push(path.to_path_buf());
    sections(&mut source, version, &mut collector)?;
    collector.finish()
}

#[derive(Debug, Clone, Copy)]
enum Version {
    V2,
    V4,
}

const SAVE_AS: &str = "Gmsh: save with Mesh.MshFileVersion = 4.1 (or 2.2)";

/// Sections that cannot be read before the format is known.
const OF_A_MESH: [&str; 6] = [
    "PhysicalNames",
    "Entities",
    "PartitionedEntities",
    "Nodes",
    "ParametricNodes",
    "Elements",
];

/// The first section that is no comment: version, ASCII or binary, byte order.
fn format(source: &mut MeshText<'_>) -> Result<Version> {
    loop {
        let first = source.text_line()?;
        let line = first.as_deref().unwrap_or_default();
        match line.strip_prefix('$') {
            Some("MeshFormat") => break,
            Some(name) if !OF_A_MESH.contains(&name) && !name.is_empty() => {
                source.skip_section(name)?;
            }
            None if first.is_some() && line.is_empty() => {}
            _ => {
                let error = source.error("$MeshFormat before the sections of an MSH file");
                return Err(error.found(line).hint(SAVE_AS));
            }
        }
    }
    let line = source.text_line()?.unwrap_or_default();
    let words: Vec<&str> = line.split_whitespace().collect();
    let [version, kind, size] = words[..] else {
        let error = source.error("version, file type and data size");
        return Err(error.found(&line));
    };
    let version = match version {
        "2.2" | "2.1" | "2" | "2.0" => Version::V2,
        "4.1" => Version::V4,
        other => {
            let error = source.error("an MSH file of version 2.2 or 4.1");
            return Err(error.found(format!("version {other}")).hint(SAVE_AS));
        }
    };
    match kind {
        "0" => {}
        "1" if size == "8" => source.binary()?,
        "1" => {
            let error = source.error("a binary file with 8 bytes for a number");
            let error = error.found(format!("{size} bytes"));
            return Err(error.hint("Gmsh: save as ASCII (Mesh.Binary = 0)"));
        }
        other => {
            let error = source.error("file type 0 (ASCII) or 1 (binary)");
            return Err(error.found(other));
        }
    }
    source.require("$EndMeshFormat")?;
    Ok(version)
}

/// All further sections.
fn sections(source: &mut MeshText<'_>, version: Version, into: &mut Collector) -> Result<()> {
    while let Some(line) = source.text_line()? {
        let Some(name) = line.strip_prefix('$') else {
            if line.is_empty() {
                continue;
            }
            let error = source.error("a section that begins with $");
            return Err(error.found(&line).hint(
                "a section before this one has more lines than its count says, or the file is damaged: save it again",
            ));
        };
        match (name, version) {
            ("PhysicalNames", _) => names(source, into)?,
            ("Entities", Version::V4) => v4::entities(source, into)?,
            ("Nodes", Version::V2) => v2::nodes(source, into, false)?,
            ("ParametricNodes", Version::V2) => v2::nodes(source, into, true)?,
            ("Nodes", Version::V4) => v4::nodes(source, into)?,
            ("Elements", Version::V2) => v2::elements(source, into)?,
            ("Elements", Version::V4) => v4::elements(source, into)?,
            ("PartitionedEntities", _) => {
                let error = source.error("a mesh that is not partitioned");
                return Err(error.found("$PartitionedEntities").hint(
                    "Gmsh: delete the partitions (Mesh > Delete > Partitions) and save again",
                ));
            }
            _ => {
                source.skip_section(name)?;
                continue;
            }
        }
        source.require(&format!("$End{name}"))?;
    }
    Ok(())
}

/// Names of physical groups, text in binary files too: `dimension number "name"`.
fn names(source: &mut MeshText<'_>, into: &mut Collector) -> Result<()> {
    let count = source.count_line("the number of physical names")?;
    for _ in 0..count {
        let line = source.more_text("a physical name")?;
        let mut words = line.splitn(3, char::is_whitespace);
        let dimension = words.next().and_then(|w| w.parse::<u8>().ok());
        let tag = words.next().and_then(|w| w.parse::<i64>().ok());
        let name = words.next().map(str::trim);
        let (Some(dimension), Some(tag), Some(name)) = (dimension, tag, name) else {
            let error = source.error("dimension, number and \"name\" of a physical group");
            return Err(error.found(&line));
        };
        into.name(dimension, tag, name.trim_matches('"').trim());
    }
    Ok(())
}
