//! VIC-3D: capitals in the unit of the calibration, mm; small letters in pixels. sigma is in pixels and -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program, stereo};

pub const PROGRAM: Program = Program {
    exports: &[ExportColumns {
        capitals_matter: true,
        ..stereo("VIC-3D", ["X", "Y", "U", "V"], Of("mm"), ["Z", "W"])
    }],
    sigma_in_pixels: &["sigma"],
    ..COLUMNS_ONLY
};
