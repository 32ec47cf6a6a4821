//! pyvale: pixels, y downwards.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        columns(
            "pyvale",
            ["subset_x", "subset_y", "disp_u", "disp_v"],
            Of(PIXEL),
        ),
        columns(
            "pyvale",
            ["subset_x", "subset_y", "displacement_u", "displacement_v"],
            Of(PIXEL),
        ),
    ],
    y_downwards: true,
    ..COLUMNS_ONLY
};
