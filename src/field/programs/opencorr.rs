//! OpenCorr: pixels, y downwards; stereo with reference places in the unit of the calibration.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        ExportColumns {
            label: "OpenCorr (stereo)",
            names: ["ref_x", "ref_y", "u", "v"],
            unit: Of("mm"),
            also: &["ref_z", "w", "r1t1 zncc"],
            capitals_matter: false,
            deformed: false,
        },
        ExportColumns {
            label: "OpenCorr",
            names: ["x", "y", "u", "v"],
            unit: Of(PIXEL),
            also: &["u0", "v0", "zncc"],
            capitals_matter: true,
            deformed: false,
        },
    ],
    y_downwards: true,
    ..COLUMNS_ONLY
};
