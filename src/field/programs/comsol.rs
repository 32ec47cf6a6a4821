//! COMSOL: the unit of the coordinates stands before the table.

use super::program::Habit::Asked;
use super::program::{COLUMNS_ONLY, Program, columns};

pub const PROGRAM: Program = Program {
    exports: &[columns("COMSOL", ["X", "Y", "u", "v"], Asked)],
    mark: Some("model,"),
    ..COLUMNS_ONLY
};
