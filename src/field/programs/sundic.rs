//! SUN-DIC: pixels, y downwards.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, stereo};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[stereo(
        "SUN-DIC",
        ["X Coord", "Y Coord", "X Disp", "Y Disp"],
        Of(PIXEL),
        ["Z Coord", "Z Disp"],
    )],
    y_downwards: true,
    ..COLUMNS_ONLY
};
