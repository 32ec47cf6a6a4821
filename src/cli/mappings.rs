//! What programs for digital image correlation call the columns of their exports.

/// Columns of one program's export.
pub struct Mapping {
    /// The program.
    pub program: &'static str,
    /// Header names of x, y, ux, uy.
    pub columns: [&'static str; 4],
    /// Unit of coordinates and displacements; `None` where they are pixels.
    pub unit: Option<&'static str>,
}

const fn mm(program: &'static str, columns: [&'static str; 4]) -> Mapping {
    Mapping {
        program,
        columns,
        unit: Some("mm"),
    }
}

/// Known exports; names are compared without regard to case. Calibrated columns come before those in pixels.
pub const MAPPINGS: &[Mapping] = &[
    mm(
        "ARAMIS / GOM (nodemap export)",
        ["x_undef [mm]", "y_undef [mm]", "u [mm]", "v [mm]"],
    ),
    mm(
        "ARAMIS / GOM",
        ["x", "y", "displacement_x", "displacement_y"],
    ),
    mm("ARAMIS / GOM", ["x", "y", "dx", "dy"]),
    mm("ARAMIS / GOM", ["X [mm]", "Y [mm]", "dX [mm]", "dY [mm]"]),
    mm("VIC-2D (calibrated)", ["x_c", "y_c", "u_c", "v_c"]),
    mm("VIC-3D", ["X", "Y", "U", "V"]),
    mm("VIC-3D", ["X [mm]", "Y [mm]", "U [mm]", "V [mm]"]),
    mm(
        "MatchID",
        [
            "coor.X [mm]",
            "coor.Y [mm]",
            "disp.Horizontal Displacement U [mm]",
            "disp.Vertical Displacement V [mm]",
        ],
    ),
    mm(
        "DICe (calibrated)",
        [
            "MODEL_COORDINATES_X",
            "MODEL_COORDINATES_Y",
            "MODEL_DISPLACEMENT_X",
            "MODEL_DISPLACEMENT_Y",
        ],
    ),
    mm(
        "plain table",
        [
            "x-coordinate [mm]",
            "y-coordinate [mm]",
            "x-displacement [mm]",
            "y-displacement [mm]",
        ],
    ),
    mm("plain table", ["x_mm", "y_mm", "ux_mm", "uy_mm"]),
    Mapping {
        program: "MatchID",
        columns: [
            "coor.X [Pixel]",
            "coor.Y [Pixel]",
            "disp.Horizontal Displacement U [Pixel]",
            "disp.Vertical Displacement V [Pixel]",
        ],
        unit: None,
    },
    Mapping {
        program: "DICe",
        columns: [
            "COORDINATE_X",
            "COORDINATE_Y",
            "DISPLACEMENT_X",
            "DISPLACEMENT_Y",
        ],
        unit: None,
    },
    mm(
        "Ncorr (as a table of plot_u_ref_formatted, plot_v_ref_formatted)",
        ["x_mm", "y_mm", "u_mm", "v_mm"],
    ),
    mm(
        "Ncorr (as a table of plot_u_ref_formatted, plot_v_ref_formatted)",
        ["x", "y", "plot_u_ref_formatted", "plot_v_ref_formatted"],
    ),
];

impl Mapping {
    /// The header's own spelling of the four columns, if all are there.
    pub fn within(&self, header: &[String]) -> Option<[String; 4]> {
        let mut found: [String; 4] = Default::default();
        for (slot, name) in found.iter_mut().zip(self.columns) {
            *slot = header
                .iter()
                .find(|h| h.eq_ignore_ascii_case(name))?
                .clone();
        }
        Some(found)
    }
}

/// The first mapping whose columns a header has.
pub fn matching(header: &[String]) -> Option<(&'static Mapping, [String; 4])> {
    // of two mappings that differ in case only, the one in the header's own spelling
    let exact = MAPPINGS
        .iter()
        .find(|m| m.columns.iter().all(|c| header.iter().any(|h| h == c)));
    exact
        .into_iter()
        .chain(MAPPINGS)
        .find_map(|m| Some((m, m.within(header)?)))
}
