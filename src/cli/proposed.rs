//! What `init` reads from a table of displacements, and what it asks for where the table does not say it.

use std::fmt::Write;
use std::path::Path;

use super::proposed_units::UnitQuestion;
use super::table_options::TableOptions;
use crate::error::{Error, Result};
use crate::field::programs::{self, FoundUnit, MatchedColumns, PROGRAMS, Program, stated_number};
use crate::field::table::{self, TableHeader};
use crate::field::{ColumnMap, Columns, DATA_AXES, Field, LEAST_CORRELATION, PIXEL, Units};

/// A table as it is read.
pub struct Export {
    pub label: String,
    pub map: ColumnMap,
    pub field: Field,
    /// Side of the subsets, pixels, as the table says.
    pub subset_px: Option<f64>,
    /// Size of a pixel on the specimen, mm, as the user or the table says.
    pub pixel_mm: Option<f64>,
    /// Whether its program gives places in the deformed state.
    pub usually_deformed: bool,
    /// What was assumed of its columns.
    pub said: String,
}

/// Name, without its unit, of a column of standard deviations of a displacement.
const SIGMA: &str = "sigma";

/// A calibrated coordinate this close to pixels, in its extent, was never calibrated.
const SAME_SCALE: f64 = 1e-6;

impl Export {
    /// Read the table `csv`.
    ///
    /// # Errors
    /// Of the input: a table that is none, columns that are not known, a unit that nothing states, an option that is not used.
    pub fn read(csv: &Path, user: &TableOptions) -> Result<Self> {
        let header = header(csv, user)?;
        let found = match &user.columns {
            Some(columns) => given(&header, columns),
            None => of_a_program(csv, &header, user)?,
        };
        let program = found.program.filter(|_| user.columns.is_none());
        let mut said = String::new();
        let (sigma, correlation) = quality(&header.names, program, user);
        let sigma_in_pixels = sigma.as_ref().is_some_and(|(_, unit)| *unit == Some(PIXEL));
        let unsettled = UnitQuestion {
            csv,
            line: header.line,
            label: &found.label,
            columns: &found.columns,
            found: found.units,
            sigma_in_pixels,
        };
        let units = unsettled.units(user, &mut said)?;
        let mut map = ColumnMap {
            columns: found.columns.clone(),
            units: Units::new(units[0], units[1]),
        };
        map.columns.correlation.clone_from(&correlation);
        if let Some((name, unit)) = sigma {
            let _ = writeln!(
                said,
                "  sigma \"{name}\": points where it is not above 0 are dropped"
            );
            if unit == Some(PIXEL) && user.mm_per_pixel.is_none() && found.scale.is_none() {
                said += "    taken to be in pixels; with units.mm_per_pixel it is each point's standard deviation too\n";
            }
            map.units.sigma = unit.map(String::from);
            map.columns.sigma = Some(name);
        }
        said += &unused_marks(&header.names, &map.columns);
        let in_pixels = units.contains(&PIXEL) || sigma_in_pixels;
        let pixel_mm = pixel(found.scale, &map.units, user, &mut said)?;
        map.units.mm_per_pixel = pixel_mm.filter(|_| in_pixels);
        said += &turn(&mut map.columns, units[0], program, user);
        let field = read(csv, &mut map, &mut said)?;
        said += &counted(&field);
        said += &stated(&header, program, user, field.levelled_deg.is_some());
        Ok(Self {
            label: found.label,
            pixel_mm,
            subset_px: program.and_then(|p| stated_number(&header.preamble, p.subset_px?)),
            usually_deformed: user.columns.is_none()
                && header.found.as_ref().is_some_and(|f| f.deformed),
            map,
            field,
            said,
        })
    }
}

/// The header of a table, with the columns that the user names.
fn header(csv: &Path, user: &TableOptions) -> Result<TableHeader> {
    let named = user
        .columns
        .as_ref()
        .map(Columns::named)
        .unwrap_or_default();
    let bare = |name: &'_ str| name.trim().trim_start_matches('-').to_string();
    let names: Vec<String> = named.iter().map(|(_, name)| bare(name)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let header = table::described(csv, &names)?;
    if let Some(uz) = user.uz.as_ref().filter(|uz| !header.names.contains(uz)) {
        let expected = format!("a column of {}: {}", csv.display(), header.names.join(", "));
        return Err(Error::input("--columns uz", expected).found(uz));
    }
    Ok(header)
}

/// The size of a pixel, mm, as the user says or the coordinates in both units, one of which is `scale` of the other.
fn pixel(
    scale: Option<f64>,
    units: &Units,
    user: &TableOptions,
    said: &mut String,
) -> Result<Option<f64>> {
    let by_table = scale.zip(units.in_mm().ok());
    let by_table = by_table.map(|(scale, [mm, _])| scale * mm);
    if let (Some(size), None) = (by_table, user.mm_per_pixel) {
        let _ = writeln!(
            said,
            "    a pixel is {size:.6} mm, by the coordinates in both units"
        );
    }
    let size = user.mm_per_pixel.or(by_table);
    if user.subset_px.is_some() && size.is_none() {
        let expected = "a table or an option that says how large a pixel is";
        return Err(Error::input("--subset-px", expected)
            .found("none")
            .hint("give --mm-per-pixel MM, or --subset-mm MM"));
    }
    Ok(size)
}

/// Turn y and uy if the user says that they count downwards; what is to be said of that.
fn turn(
    columns: &mut Columns,
    unit: &str,
    program: Option<&Program>,
    user: &TableOptions,
) -> String {
    if user.y_down {
        for name in [&mut columns.y, &mut columns.uy] {
            *name = match name.strip_prefix('-') {
                Some(plain) => plain.into(),
                None => format!("-{name}"),
            };
        }
        let Columns { y, uy, .. } = columns;
        return format!(
            "  y and uy are turned, so that y counts upwards (columns.y \"{y}\", columns.uy \"{uy}\")\n"
        );
    }
    match program {
        Some(program) if !program.y_downwards => String::new(),
        _ if unit != PIXEL => String::new(),
        _ => "  pixels: where y counts downwards in the picture, angles in the data's x-y plane turn clockwise in it; --y-down turns y and uy\n".into(),
    }
}

/// The field, without the coefficient of the correlation where that is none.
fn read(csv: &Path, map: &mut ColumnMap, said: &mut String) -> Result<Field> {
    let mut read = table::read_said(csv, map, DATA_AXES);
    if let Some(name) = map.columns.correlation.clone() {
        if let Err(error) = &read {
            let _ = writeln!(said, "  \"{name}\" is not used: {error}");
            map.columns.correlation = None;
            read = table::read_said(csv, map, DATA_AXES);
        } else {
            let _ = writeln!(
                said,
                "  correlation \"{name}\": points below {LEAST_CORRELATION} are dropped"
            );
        }
    }
    let (field, remarks) = read?;
    for remark in remarks {
        let _ = writeln!(said, "  {remark}");
    }
    Ok(field)
}

/// Columns before their units are settled.
struct Chosen {
    label: String,
    program: Option<&'static Program>,
    columns: Columns,
    units: [FoundUnit; 2],
    /// Units of a coordinate in a pixel, if the table has both.
    scale: Option<f64>,
}

/// The columns that the user names.
fn given(header: &TableHeader, columns: &Columns) -> Chosen {
    let unit = |name: &str| {
        let name = name.trim().trim_start_matches('-');
        let below = header
            .units
            .as_ref()
            .zip(header.names.iter().position(|n| n == name));
        programs::split(name)
            .1
            .or_else(|| below.and_then(|(units, k)| units.get(k).copied().flatten()))
    };
    let both = |a: &str, b: &str| match (unit(a), unit(b)) {
        (Some(a), Some(b)) if a == b => FoundUnit::Stated(a),
        _ => FoundUnit::Unknown,
    };
    Chosen {
        label: "your choice".into(),
        program: None,
        columns: columns.clone(),
        units: [both(&columns.x, &columns.y), both(&columns.ux, &columns.uy)],
        scale: None,
    }
}

/// The columns of a program that is known.
fn of_a_program(csv: &Path, header: &TableHeader, user: &TableOptions) -> Result<Chosen> {
    let Some(MatchedColumns {
        program,
        label,
        columns,
        units,
        ..
    }) = &header.found
    else {
        return Err(unknown(csv, header));
    };
    let (columns, mut units) = (columns.clone(), *units);
    let mut label = label.to_string();
    let scale = scale(csv, &columns, &header.names);
    if scale.is_some_and(|mm| (mm - 1.0).abs() < SAME_SCALE) && user.units.is_none() {
        label = format!(
            "{}, not calibrated (x_c is x moved)",
            label.split(" (").next().unwrap_or(&label)
        );
        units = [FoundUnit::Usual(PIXEL); 2];
    }
    Ok(Chosen {
        label,
        program: Some(program),
        columns: Columns::new(columns),
        units,
        scale,
    })
}

/// Units of a calibrated coordinate in a pixel, where the table has both: `x_c` and `x`.
fn scale(csv: &Path, [x, y, ux, uy]: &[String; 4], names: &[String]) -> Option<f64> {
    let raw = |name: &String| {
        name.strip_suffix("_c")
            .map(String::from)
            .filter(|raw| names.contains(raw))
    };
    let width = |x: &str, y: &str| {
        let columns = Columns::new([x, y, ux, uy].map(|s: &str| s.to_string()));
        let map = ColumnMap {
            columns,
            units: Units::new("um", "um"),
        };
        let [low, high] = table::read(csv, &map, DATA_AXES).ok()?.bounds();
        Some(high[0] - low[0]).filter(|width| *width > 0.0)
    };
    Some(width(x, y)? / width(&raw(x)?, &raw(y)?)?)
}

/// No columns that are known.
fn unknown(csv: &Path, header: &TableHeader) -> Error {
    let mut known: Vec<&str> = Vec::new();
    for export in PROGRAMS.iter().flat_map(|p| p.exports) {
        let name = export.label.split(" (").next().unwrap_or(export.label);
        if !known.contains(&name) {
            known.push(name);
        }
    }
    let units = header.names.iter().map(|n| programs::split(n).1.is_some());
    let mixed = if units.filter(|u| *u).count() > 1 {
        "one unit for both coordinates and one for both displacements; or "
    } else {
        ""
    };
    Error::input(
        format!("--csv {}:{}", csv.display(), header.line),
        format!("columns as one of these writes them: {}", known.join(", ")),
    )
    .found(header.names.join(", "))
    .hint(format!(
        "{mixed}say which columns they are: --columns x=NAME,y=NAME,ux=NAME,uy=NAME; they go into measurement.columns"
    ))
}

/// What is said of columns that mark points and are not used.
fn unused_marks(header: &[String], used: &Columns) -> String {
    let used = used.named();
    let is_used = |name: &String| used.iter().any(|(_, own)| own == name);
    let words = programs::all_words(|p| p.marks);
    let is_mark = |name: &&String| words.contains(&name.trim().to_lowercase().as_str());
    let marks = header.iter().filter(is_mark).filter(|name| !is_used(name));
    let say = |name: &String| {
        format!(
            "  column \"{name}\" is not used: if it marks points that failed, take them out of the file\n"
        )
    };
    marks.map(say).collect()
}

/// A column of standard deviations with its unit, if that is not the displacements', and one of correlation coefficients.
pub fn quality(
    header: &[String],
    program: Option<&Program>,
    user: &TableOptions,
) -> (Option<(String, Option<&'static str>)>, Option<String>) {
    let with_unit = |name: String| {
        let unit = programs::split(&name).1;
        (name, unit)
    };
    let find = |word: &str| programs::named(header, &[&word.to_lowercase()]).cloned();
    if let Some(columns) = &user.columns {
        // whose sigma it is, is not known: it tells the points that failed
        let found = || Some((find(SIGMA)?, Some(PIXEL)));
        let sigma = columns.sigma.clone().map(with_unit).or_else(found);
        return (sigma, columns.correlation.clone());
    }
    let in_pixels = program.and_then(|p| p.sigma_in_pixels.iter().find_map(|word| find(word)));
    let in_pixels = in_pixels.map(with_unit);
    let in_pixels = in_pixels.map(|(name, unit)| (name, unit.or(Some(PIXEL))));
    let sigma = in_pixels.or_else(|| find(SIGMA).map(with_unit));
    let words = programs::all_words(|p| p.correlation);
    (sigma, programs::named(header, &words).cloned())
}

/// Points that are not used, by reason.
fn counted(field: &Field) -> String {
    let rejected = &field.rejected;
    let all = [
        (rejected.missing, "without a value"),
        (rejected.uncorrelated, "that did not correlate"),
        (rejected.repeated, "that stand in the file again"),
    ];
    let parts: Vec<String> = all
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, why)| format!("{n} {why}"))
        .collect();
    if parts.is_empty() {
        String::new()
    } else {
        format!("  points not used: {}\n", parts.join(", "))
    }
}

/// What the lines before the table say, and its column out of the plane.
fn stated(
    header: &TableHeader,
    program: Option<&Program>,
    user: &TableOptions,
    is_levelled: bool,
) -> String {
    let mut said = String::new();
    if let Some(program) = program {
        if let Some(step) = program
            .step_px
            .and_then(|words| stated_number(&header.preamble, words))
        {
            let _ = writeln!(said, "  step of the grid {step} px, as the file says");
        }
        if let Some(picture) = program
            .picture
            .and_then(|words| programs::stated(&header.preamble, words))
        {
            let _ = writeln!(said, "  picture {picture}, as the file says");
        }
    }
    if programs::stated(&header.preamble, "incremental correlation")
        .is_some_and(|text| text.to_lowercase().starts_with("true"))
    {
        said += "  the file says \"incremental correlation: true\": displacements from picture to picture; correlate all pictures with one reference\n";
    }
    let words = programs::out_of_plane();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let uz = user.uz.as_ref();
    if let Some(name) = uz.or_else(|| programs::named(&header.names, &words)) {
        let used = if is_levelled {
            "used for the tilt of the plane alone"
        } else {
            "not used"
        };
        let _ = writeln!(
            said,
            "  out of the plane \"{name}\": {used}; if it changes from step to step, declare the effects out_of_plane_translation and out_of_plane_rotation"
        );
    }
    said
}
