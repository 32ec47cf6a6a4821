//! GOM and ZEISS (Correlate, INSPECT, ARAMIS). The tables of GOM hold deformed places, x + displacement; node maps hold both apart.

use super::program::Habit::{Asked, Of};
use super::program::{COLUMNS_ONLY, ExportColumns, Program, columns, stereo};

const fn deformed(names: [&'static str; 4]) -> ExportColumns {
    ExportColumns {
        deformed: true,
        ..columns("ARAMIS / GOM", names, Of("mm"))
    }
}

pub const PROGRAM: Program = Program {
    exports: &[
        stereo(
            "ARAMIS / GOM (nodemap export)",
            ["x_undef", "y_undef", "u", "v"],
            Of("mm"),
            ["z_undef", "w"],
        ),
        ExportColumns {
            out_of_plane: ["z", "displacement_z"],
            ..deformed(["x", "y", "displacement_x", "displacement_y"])
        },
        ExportColumns {
            also: &["z"],
            out_of_plane: ["z", "dz"],
            ..deformed(["x", "y", "dx", "dy"])
        },
        // any program may call them so
        ExportColumns {
            unit: Asked,
            ..deformed(["x", "y", "dx", "dy"])
        },
    ],
    subset_px: Some("facet_size"),
    step_px: Some("facet_distance"),
    ..COLUMNS_ONLY
};
