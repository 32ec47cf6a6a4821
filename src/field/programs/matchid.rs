//! MatchID 2-D and stereo of 2024, with units in the names, and stereo of 2023, without.

use super::program::Habit::{Asked, Of};
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns};
use crate::field::reader::PIXEL;

const U: &str = "disp.Horizontal Displacement U";
const V: &str = "disp.Vertical Displacement V";

pub const PROGRAM: Program = Program {
    exports: &[
        columns("MatchID", ["coor.X", "coor.Y", U, V], Of(PIXEL)),
        columns("MatchID", ["coor.Image X", "coor.Image Y", U, V], Of(PIXEL)),
        columns(
            "MatchID",
            ["Coordinates.Image X", "Coordinates.Image Y", U, V],
            Of(PIXEL),
        ),
        ExportColumns {
            label: "MatchID (2023)",
            names: ["x", "y", "u", "v"],
            unit: Asked,
            also: &["x_pic", "y_pic"],
            capitals_matter: true,
            deformed: false,
        },
    ],
    y_downwards: true,
    ..COLUMNS_ONLY
};
