//! SUN-DIC: pixels, y downwards.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[columns(
        "SUN-DIC",
        ["X Coord", "Y Coord", "X Disp", "Y Disp"],
        Of(PIXEL),
    )],
    y_downwards: true,
    ..COLUMNS_ONLY
};
