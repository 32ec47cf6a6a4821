//! What programs for digital image correlation call the columns of their exports.

use crate::field::PIXEL;

/// Columns of one program's export.
pub struct Mapping {
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

/// Columns of a header that hold a field.
pub struct MatchedMapping {
    /// The program whose columns they are.
    pub program: &'static str,
    /// x, y, ux, uy in the header's own spelling.
    pub columns: [String; 4],
    /// Units of the coordinates and of the displacements; `None` where they are pixels.
    pub units: [Option<&'static str>; 2],
}

/// Names, without their unit, of columns that hold the standard deviation of a displacement and the coefficient of the
/// correlation.
const SIGMA: &str = "sigma";
const CORRELATION: &[&str] = &[
    "zncc",
    "correlation",
    "correlation coefficient",
    "correlation value",
    "samecamera.correlation value",
];

/// Programs that state their sigma in pixels whatever the unit of the displacements.
const SIGMA_IN_PIXELS: &[&str] = &["VIC", "DICe"];

/// A column of standard deviations with its unit, if that is not the displacements', and one of correlation coefficients.
pub fn quality(
    header: &[String],
    program: &str,
) -> (Option<(String, Option<&'static str>)>, Option<String>) {
    let sigma = header
        .iter()
        .find(|h| split(h).0.eq_ignore_ascii_case(SIGMA));
    let sigma = sigma.cloned().map(|name| {
        let unit = match split(&name).1 {
            Some(stated) => Some(stated.unwrap_or(PIXEL)),
            None => {
                let in_pixels = SIGMA_IN_PIXELS.iter().any(|p| program.starts_with(p));
                in_pixels.then_some(PIXEL)
            }
        };
        (name, unit)
    });
    // a unit in brackets that is none, [-] or [1], stands behind some of these names
    let bare = |name: &str| {
        name.split(['[', '('])
            .next()
            .unwrap_or(name)
            .trim()
            .to_lowercase()
    };
    let correlation = header
        .iter()
        .find(|h| CORRELATION.contains(&bare(h).as_str()));
    (sigma, correlation.cloned())
}

/// The columns of the first mapping that a header has. Calibrated ones in the mapping's own spelling go first, then ones
/// whose units the header states, then ones in other capitals, last those in pixels.
pub fn matching(header: &[String]) -> Option<MatchedMapping> {
    let spelled = |calibrated: bool, same: &dyn Fn(&str, &str) -> bool| {
        let mut mappings = MAPPINGS.iter().filter(|m| m.unit.is_some() == calibrated);
        mappings.find_map(|mapping| {
            let named = |name: &&str| header.iter().find(|h| same(h, name)).cloned();
            let columns: Vec<String> = mapping.columns.iter().map_while(named).collect();
            Some(MatchedMapping {
                program: mapping.program,
                columns: columns.try_into().ok()?,
                units: [mapping.unit; 2],
            })
        })
    };
    let stated = |calibrated: bool| {
        let mut found = MAPPINGS.iter().filter_map(|m| with_stated_units(m, header));
        found.find(|f| f.units.iter().all(Option::is_some) == calibrated)
    };
    let capitals = |a: &str, b: &str| a.eq_ignore_ascii_case(b);
    spelled(true, &|a, b| a == b)
        .or_else(|| stated(true))
        .or_else(|| spelled(true, &capitals))
        .or_else(|| spelled(false, &capitals))
        .or_else(|| stated(false))
}

/// Columns of a mapping by their names without units, where the header states a unit for each, one for the coordinates
/// and one for the displacements. A unit of length goes before pixels.
fn with_stated_units(mapping: &Mapping, header: &[String]) -> Option<MatchedMapping> {
    let column = |name: &&str| {
        let (stem, _) = split(name);
        let named = header.iter().filter_map(|h| {
            let (other, unit) = split(h);
            Some((h.clone(), unit?)).filter(|_| other.eq_ignore_ascii_case(stem))
        });
        named.min_by_key(|(_, unit)| unit.is_none())
    };
    let found: Vec<_> = mapping.columns.iter().map_while(column).collect();
    let [x, y, ux, uy] = <[_; 4]>::try_from(found).ok()?;
    (x.1 == y.1 && ux.1 == uy.1).then_some(MatchedMapping {
        program: mapping.program,
        units: [x.1, ux.1],
        columns: [x.0, y.0, ux.0, uy.0],
    })
}

/// A column's name and the unit behind it, in brackets or after an underscore; the unit of `Some(None)` is the pixel.
fn split(name: &str) -> (&str, Option<Option<&'static str>>) {
    let bracketed = [('[', ']'), ('(', ')')]
        .into_iter()
        .find_map(|(open, close)| {
            let (stem, unit) = name.trim().strip_suffix(close)?.rsplit_once(open)?;
            Some((stem.trim_end(), unit))
        });
    let parts = bracketed.or_else(|| name.rsplit_once('_'));
    let known = parts.and_then(|(stem, unit)| {
        let unit = match unit.trim().to_lowercase().as_str() {
            "m" => Some("m"),
            "mm" => Some("mm"),
            "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" => Some("um"),
            "nm" => Some("nm"),
            "in" | "inch" => Some("in"),
            "px" | "pixel" | "pixels" => None,
            _ => return None,
        };
        Some((stem, Some(unit)))
    });
    known.unwrap_or((name.trim(), None))
}
