//! Tables of nobody in particular.

use super::program::Habit::Asked;
use super::program::{COLUMNS_ONLY, Program, columns};

pub const PROGRAM: Program = Program {
    exports: &[
        columns("plain table", ["x", "y", "ux", "uy"], Asked),
        columns("plain table", ["x", "y", "u", "v"], Asked),
        columns("plain table", ["x", "y", "U_x", "U_y"], Asked),
        columns(
            "plain table",
            [
                "x-coordinate",
                "y-coordinate",
                "x-displacement",
                "y-displacement",
            ],
            Asked,
        ),
    ],
    ..COLUMNS_ONLY
};
