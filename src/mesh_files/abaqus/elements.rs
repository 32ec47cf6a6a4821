//! Element types of Abaqus and CalculiX.

use super::super::kind::ElementKind;
use crate::error::{Error, Result};

/// What an element type is here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Type {
    Plane(ElementKind),
    /// A shell or membrane, whose edges go by other names than those of plane elements.
    Shell(ElementKind),
    /// Nine nodes, of which the last, in the middle, is dropped.
    Nine,
    /// Of two or three nodes; its sets name edges.
    Line(usize),
    /// A mass, a spring or what else has no area: left out.
    LeftOut,
}

impl Type {
    /// Number of nodes in the file.
    pub fn nodes(self) -> usize {
        match self {
            Type::Plane(kind) | Type::Shell(kind) => kind.nodes(),
            Type::Nine => 9,
            Type::Line(nodes) => nodes,
            Type::LeftOut => 0,
        }
    }
}

/// The type of a name. Integration, hourglass control and thickness do not matter: only the plate's shape is read.
///
/// # Errors
/// The input's fault, at `place`: elements in space, of plane strain or about an axis, or unknown.
pub(super) fn of(name: &str, place: impl Fn() -> String) -> Result<Type> {
    let upper = name.to_ascii_uppercase();
    let is = |prefixes: &[&str]| prefixes.iter().any(|p| upper.starts_with(p));
    Ok(match upper.as_str() {
        "CPS3" | "CPS3T" => Type::Plane(ElementKind::T3),
        "CPS4" | "CPS4R" | "CPS4I" | "CPS4T" | "CPS4RT" => Type::Plane(ElementKind::Q4),
        "CPS6" | "CPS6M" | "CPS6MT" => Type::Plane(ElementKind::T6),
        "CPS8" | "CPS8R" | "CPS8T" | "CPS8RT" => Type::Plane(ElementKind::Q8),
        "S3" | "S3R" | "S3RS" | "S3T" | "S3RT" | "STRI3" | "M3D3" => Type::Shell(ElementKind::T3),
        "S4" | "S4R" | "S4R5" | "S4RS" | "S4RSW" | "S4T" | "S4RT" | "M3D4" | "M3D4R" => {
            Type::Shell(ElementKind::Q4)
        }
        "STRI65" | "S6" | "M3D6" => Type::Shell(ElementKind::T6),
        "S8" | "S8R" | "S8R5" | "S8RT" | "M3D8" | "M3D8R" => Type::Shell(ElementKind::Q8),
        "M3D9" | "M3D9R" | "S9R5" => Type::Nine,
        _ if is(&WITHOUT_AREA) => Type::LeftOut,
        _ if is(&["T2D3", "T3D3", "B22", "B32", "PIPE22", "PIPE32"]) => Type::Line(3),
        _ if is(&[
            "T2D2", "T3D2", "B21", "B23", "B31", "B33", "PIPE21", "PIPE31",
        ]) =>
        {
            Type::Line(2)
        }
        _ => return Err(refused(name, &upper, place())),
    })
}

/// What types begin with that stand at points or between two of them: masses, springs, dashpots, connectors, gaps, couplings, rigid links.
const WITHOUT_AREA: [&str; 18] = [
    "MASS", "ROTARY", "HEATCAP", "CAP", "SPRING", "DASHPOT", "CONN", "JOINT", "GAP", "DGAP", "ITS",
    "ITT", "DCOUP", "RB2D2", "RB3D2", "R2D2", "FRAME", "DRAG",
];

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
