//! Istra4D of Dantec: DICe's names in small letters, and millimetres.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, ExportColumns, Program, stereo};

pub const PROGRAM: Program = Program {
    exports: &[ExportColumns {
        capitals_matter: true,
        ..stereo(
            "Istra4D",
            [
                "coordinate_x",
                "coordinate_y",
                "displacement_x",
                "displacement_y",
            ],
            Of("mm"),
            ["coordinate_z", "displacement_z"],
        )
    }],
    as_text: Some("of Istra4D export the steps as text (ASCII)"),
    ..COLUMNS_ONLY
};
