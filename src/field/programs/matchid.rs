//! MatchID 2-D and stereo: of 2024 with groups in the names, of 2023 with short names and without units, and older ones without groups.

use super::program::Habit::{Asked, Of};
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns, stereo};
use crate::field::reader::PIXEL;

const LABEL: &str = "MatchID";
const U: &str = "disp.Horizontal Displacement U";
const V: &str = "disp.Vertical Displacement V";
const OLD_U: &str = "Horizontal Displacement U";
const OLD_V: &str = "Vertical Displacement V";

pub const PROGRAM: Program = Program {
    exports: &[
        columns(LABEL, ["coor.Image X", "coor.Image Y", U, V], Of(PIXEL)),
        columns(
            LABEL,
            ["Coordinates.Image X", "Coordinates.Image Y", U, V],
            Of(PIXEL),
        ),
        stereo(
            LABEL,
            ["coor.X", "coor.Y", U, V],
            Of(PIXEL),
            ["coor.Z", "disp.Out-Of-Plane: W"],
        ),
        stereo(
            LABEL,
            ["coor.X", "coor.Y", U, V],
            Of(PIXEL),
            ["coor.Z", "disp.Out-Of-Plane Displacement W"],
        ),
        ExportColumns {
            also: &["x_pic", "y_pic"],
            capitals_matter: true,
            ..stereo("MatchID (2023)", ["x", "y", "u", "v"], Asked, ["z", "w"])
        },
        columns(LABEL, ["Image X", "Image Y", OLD_U, OLD_V], Of(PIXEL)),
        columns(
            LABEL,
            ["Image X", "Image Y", "Horizontal: u", "Vertical: v"],
            Of(PIXEL),
        ),
        stereo(
            LABEL,
            ["X", "Y", OLD_U, OLD_V],
            Of("mm"),
            ["Z", "Out-Of-Plane: W"],
        ),
    ],
    y_downwards: true,
    correlation: &[
        "correlation value",
        "samecamera.correlation value",
        "correlation coefficient: r",
        "correlation coefficient",
    ],
    ..COLUMNS_ONLY
};
