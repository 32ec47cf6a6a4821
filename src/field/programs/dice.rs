//! DICe: pixels, y downwards; stereo beside them in the unit of its calibration. SIGMA and MATCH are -1 where the correlation failed.

use super::program::Habit::Of;
use super::program::{Program, columns};
use crate::field::reader::PIXEL;

pub const PROGRAM: Program = Program {
    exports: &[
        columns(
            "DICe (calibrated)",
            [
                "MODEL_COORDINATES_X",
                "MODEL_COORDINATES_Y",
                "MODEL_DISPLACEMENT_X",
                "MODEL_DISPLACEMENT_Y",
            ],
            Of("mm"),
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
};
