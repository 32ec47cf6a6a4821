//! VIC-2D: `x_c` to `v_c` by its calibration, `x` to `v` in pixels. sigma is in pixels and -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        columns(
            "VIC-2D (calibrated)",
            ["x_c", "y_c", "u_c", "v_c"],
            Of("mm"),
        ),
        ExportColumns {
            label: "VIC-2D (not calibrated)",
            names: ["x", "y", "u", "v"],
            unit: Of(PIXEL),
            also: &["exx", "eyy", "sigma"],
            capitals_matter: true,
            deformed: false,
        },
    ],
    sigma_in_pixels: &["sigma"],
    ..COLUMNS_ONLY
};
