//! VIC-2D: `x_c` to `v_c` by its calibration, `x` to `v` in pixels. sigma is in pixels and -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns, stereo};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        stereo(
            "VIC-2D (calibrated)",
            ["x_c", "y_c", "u_c", "v_c"],
            Of("mm"),
            ["z_c", "w_c"],
        ),
        ExportColumns {
            also: &["exx", "eyy", "sigma"],
            capitals_matter: true,
            ..columns("VIC-2D (not calibrated)", ["x", "y", "u", "v"], Of(PIXEL))
        },
    ],
    sigma_in_pixels: &["sigma"],
    ..COLUMNS_ONLY
};
