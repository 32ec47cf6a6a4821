//! OpenCorr: pixels, y downwards; stereo with reference places in the unit of the calibration.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns, stereo};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        ExportColumns {
            also: &["ref_z", "w", "r1t1 zncc"],
            ..stereo(
                "OpenCorr (stereo)",
                ["ref_x", "ref_y", "u", "v"],
                Of("mm"),
                ["ref_z", "w"],
            )
        },
        ExportColumns {
            also: &["u0", "v0", "zncc"],
            capitals_matter: true,
            ..columns("OpenCorr", ["x", "y", "u", "v"], Of(PIXEL))
        },
    ],
    y_downwards: true,
    correlation: &["zncc", "r1t1 zncc"],
    ..COLUMNS_ONLY
};
