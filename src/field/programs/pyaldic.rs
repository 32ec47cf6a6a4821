//! pyALDIC: pixels, y downwards; its .mat files with the places in one array.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        // x_px, y_px: the displacements are in pixels as well
        columns("pyALDIC", ["x", "y", "disp_u", "disp_v"], Of(PIXEL)),
        columns(
            "pyALDIC",
            ["CoordinatesFEM_1", "CoordinatesFEM_2", "disp_U", "disp_V"],
            Of(PIXEL),
        ),
    ],
    y_downwards: true,
    ..COLUMNS_ONLY
};
