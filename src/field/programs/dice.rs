//! DICe: pixels, y downwards; stereo beside them in the unit of its calibration. SIGMA and MATCH are -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{COLUMNS_ONLY, Program, columns, stereo};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        stereo(
            "DICe (calibrated)",
            [
                "MODEL_COORDINATES_X",
                "MODEL_COORDINATES_Y",
                "MODEL_DISPLACEMENT_X",
                "MODEL_DISPLACEMENT_Y",
            ],
            Of("mm"),
            ["MODEL_COORDINATES_Z", "MODEL_DISPLACEMENT_Z"],
        ),
        columns(
            "DICe",
            [
                "COORDINATE_X",
                "COORDINATE_Y",
                "DISPLACEMENT_X",
                "DISPLACEMENT_Y",
            ],
            Of(PIXEL),
        ),
    ],
    sigma_in_pixels: &["SIGMA", "MATCH"],
    y_downwards: true,
    subset_px: Some("subset size"),
    step_px: Some("step size"),
    picture: Some("deformed image"),
    mark: Some("digital image correlation engine"),
    as_text: Some("of DICe give DICe_solution_N.txt"),
    ..COLUMNS_ONLY
};
