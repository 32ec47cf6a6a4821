//! crackpy: node maps of its finite elements, mm.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns};

pub const PROGRAM: Program = Program {
    exports: &[columns(
        "crackpy (nodemap)",
        ["x_undf", "y_undf", "ux", "uy"],
        Of("mm"),
    )],
    ..COLUMNS_ONLY
};
