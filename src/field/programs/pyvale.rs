//! pyvale: pixels, y downwards.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns, stereo};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        columns(
            "pyvale",
            ["subset_x", "subset_y", "disp_u", "disp_v"],
            Of(PIXEL),
        ),
        stereo(
            "pyvale",
            ["subset_x", "subset_y", "displacement_u", "displacement_v"],
            Of(PIXEL),
            ["", "displacement_w"],
        ),
    ],
    y_downwards: true,
    correlation: &["cost_zncc"],
    ..COLUMNS_ONLY
};
