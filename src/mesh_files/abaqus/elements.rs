//! Element types of Abaqus and CalculiX.

use super::super::kind::Kind;
use crate::error::{Error, Result};

/// What an element type is here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
    Plane(Kind),
    /// A shell or membrane, whose edges go by other names than those of plane elements.
    Shell(Kind),
    /// Nine nodes, of which the last, in the middle, is dropped.
    Nine,
    /// Of two or three nodes; its sets name edges.
    Line(usize),
}

impl Type {
    /// Number of nodes in the file.
    pub fn nodes(self) -> usize {
        match self {
            Type::Plane(kind) | Type::Shell(kind) => kind.nodes(),
            Type::Nine => 9,
            Type::Line(nodes) => nodes,
        }
    }
}

/// The type of a name. Integration, hourglass control and thickness do not matter: only the plate's shape is read.
///
/// # Errors
/// The input's fault, at `place`: elements in space, of plane strain or about an axis, or unknown.
pub(super) fn of(name: &str, place: impl Fn() -> String) -> Result<Type> {
    let upper = name.to_ascii_uppercase();
    Ok(match upper.as_str() {
        "CPS3" => Type::Plane(Kind::T3),
        "CPS4" | "CPS4R" | "CPS4I" => Type::Plane(Kind::Q4),
        "CPS6" | "CPS6M" => Type::Plane(Kind::T6),
        "CPS8" | "CPS8R" => Type::Plane(Kind::Q8),
        "S3" | "S3R" | "M3D3" => Type::Shell(Kind::T3),
        "S4" | "S4R" | "S4R5" | "M3D4" | "M3D4R" => Type::Shell(Kind::Q4),
        "STRI65" | "S6" | "M3D6" => Type::Shell(Kind::T6),
        "S8" | "S8R" | "S8R5" | "M3D8" | "M3D8R" => Type::Shell(Kind::Q8),
        "M3D9" | "M3D9R" | "S9R5" => Type::Nine,
        "T2D2" | "T3D2" | "B21" | "B23" | "B31" | "B33" => Type::Line(2),
        "T2D3" | "T3D3" | "B22" | "B32" => Type::Line(3),
        _ => return Err(refused(name, &upper, place())),
    })
}

fn refused(name: &str, upper: &str, place: String) -> Error {
    let is = |prefixes: &[&str]| prefixes.iter().any(|p| upper.starts_with(p));
    let (what, hint) = if is(&["C3D", "SC6", "SC8", "CSS8", "CCL", "DC3D", "AC3D"]) {
        (
            "three-dimensional elements",
            "make a two-dimensional or a shell part of the specimen and mesh that",
        )
    } else if is(&["CPE", "CPEG", "CAX", "CGAX", "SAX", "MAX"]) {
        (
            "elements of plane strain or about an axis",
            "the plate is in plane stress: assign CPS elements (Mesh > Element type)",
        )
    } else {
        (
            "a type that is not known here",
            "delete these elements from the file, or assign one of the known types (Mesh > Element type)",
        )
    };
    let expected = "plane-stress, shell or membrane elements: CPS3, CPS4(R), CPS6, CPS8(R), S3, S4(R), S8R, STRI65, M3D3 to M3D8(R)";
    Error::input(place, expected)
        .found(format!("{name}: {what}"))
        .hint(hint)
}
