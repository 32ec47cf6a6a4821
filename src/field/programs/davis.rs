//! DaVis: units in the line that begins with its name, or in the names of a CSV.

use super::program::Habit::Asked;
use super::program::{COLUMNS_ONLY, Program, columns};

pub const PROGRAM: Program = Program {
    exports: &[
        columns("DaVis", ["x", "y", "Vx", "Vy"], Asked),
        columns(
            "DaVis",
            ["x", "y", "x-displacement", "y-displacement"],
            Asked,
        ),
    ],
    mark: Some("davis"),
    ..COLUMNS_ONLY
};
