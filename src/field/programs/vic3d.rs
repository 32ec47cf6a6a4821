//! VIC-3D: capitals in the unit of the calibration, mm; small letters in pixels. sigma is in pixels and -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program};

pub const PROGRAM: Program = Program {
    exports: &[ExportColumns {
        label: "VIC-3D",
        names: ["X", "Y", "U", "V"],
        unit: Of("mm"),
        also: &[],
        capitals_matter: true,
        deformed: false,
    }],
    sigma_in_pixels: &["sigma"],
    ..COLUMNS_ONLY
};
