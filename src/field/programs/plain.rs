//! Tables of nobody in particular.

use super::program::Habit::Asked;
use super::program::{COLUMNS_ONLY, Program, columns, stereo};

const LABEL: &str = "plain table";

pub const PROGRAM: Program = Program {
    exports: &[
        stereo(LABEL, ["x", "y", "ux", "uy"], Asked, ["z", "uz"]),
        stereo(LABEL, ["x", "y", "u", "v"], Asked, ["z", "w"]),
        columns(LABEL, ["x", "y", "U_x", "U_y"], Asked),
        columns(
            LABEL,
            [
                "x-coordinate",
                "y-coordinate",
                "x-displacement",
                "y-displacement",
            ],
            Asked,
        ),
    ],
    correlation: &["correlation"],
    marks: &[
        "mask",
        "valid",
        "status",
        "converged",
        "flag",
        "flags",
        "typevector",
        "outlier",
    ],
    ..COLUMNS_ONLY
};
