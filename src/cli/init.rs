//! `plychain init`: a model file to start from, for one's own specimen.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::mappings::{MAPPINGS, matching};
use super::print;
use crate::error::{Error, Result};
use crate::field::{Axis, ColumnMap, Columns, Field, Frame, Units, table};
use crate::files;
use crate::infer::Model;
use crate::report::FieldCells;

/// Arguments of `init`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain init                                   a carbon/epoxy laminate, to be edited
  plychain init strip --like steel                a copy of the steel strip's model
  plychain init strip --like steel --csv field.csv    columns, hole and axis read from a DIC export")]
pub struct Arguments {
    /// Name of the model; the file is NAME.json
    #[arg(default_value = "specimen")]
    name: String,
    /// The model to start from
    #[arg(long, value_enum, default_value = "openhole")]
    like: Like,
    /// A DIC export: its columns are mapped, and the hole and the loading axis proposed from it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// The models that come with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Like {
    /// The laminate of the open-hole test
    Openhole,
    /// The isotropic strip
    Steel,
}

impl Like {
    fn text(self) -> &'static str {
        match self {
            Self::Openhole => include_str!("../../models/openhole.json"),
            Self::Steel => include_str!("../../models/steel-s235.json"),
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let path = PathBuf::from(format!("{}.json", arguments.name));
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    if arguments.name.is_empty() || !arguments.name.chars().all(plain) {
        return Err(Error::input("NAME", "letters, digits, - _ .").found(&arguments.name));
    }
    if path.exists() {
        return Err(
            Error::input(path.display(), "a file that does not exist yet")
                .found("an existing one")
                .hint("give another name: plychain init NAME"),
        );
    }
    let mut model: Value = serde_json::from_str(arguments.like.text())
        .map_err(|e| Error::program("the shipped model", "valid JSON").found(e))?;
    model["name"] = json!(arguments.name);
    model["note"] = json!(NOTE);
    let experiment = &mut model["experiments"][0];
    experiment["effects"] = json!(["rigid_translation", "rigid_rotation"]);
    experiment["gauge"] = json!("window");
    experiment["specimen"]["note"] =
        json!("dimensions in mm; hole.center_mm from the plate's centre, (along the load, across)");
    if let Some(specimen) = experiment["specimen"].as_object_mut() {
        // The clamp is the rig's of that test, and no part of another.
        specimen.remove("clamp");
    }
    let (measurement, said) = match &arguments.csv {
        Some(csv) => propose(csv, &mut experiment["specimen"])?,
        None => (unread(), String::new()),
    };
    experiment["measurement"] = measurement;
    if let Some(reduced) = model["reduced_model"].as_object_mut() {
        reduced.remove("reference");
    }
    let mut text = serde_json::to_string_pretty(&model)
        .map_err(|e| Error::program("model", "values that JSON can hold").found(e))?;
    text.push('\n');
    Model::parse(&text, &path)?;
    files::replace(&path, text)?;
    print(&format!(
        "{} written\n{said}{}",
        path.display(),
        next(&path)
    ))
}

/// What the file's `note` says.
const NOTE: &str = "A starting model: specimen, layup, thickness, force and priors are those of the model it was copied from. Replace them by your own. Units stand in the names; layup_deg counts from the loading axis, counter-clockwise in the data's x-y plane. A displacement field without an origin needs rigid_translation; one whose camera may be turned needs rigid_rotation. Every key is checked: plychain build NAME.json says what is wrong. Notes like this one may be removed.";

/// A measurement whose file is still to be named.
fn unread() -> Value {
    json!({
        "format": "csv",
        "file": "displacements.csv",
        "columns": { "x": "x_mm", "y": "y_mm", "ux": "ux_mm", "uy": "uy_mm" },
        "units": { "coordinates": "mm", "displacements": "mm" },
        "loading_axis": "x",
        "hole_center_in_data_mm": [0.0, 0.0],
    })
}

/// What to do with the file.
fn next(path: &Path) -> String {
    format!(
        "\nto be edited before the first run, because no file of displacements says it:
  material.parameters               priors: what is known of the constants beforehand
and of the experiment
  specimen.length_mm, width_mm      the plate between the grips
  specimen.hole                     diameter, and place from the plate's centre
  specimen.layup_deg, thickness_mm  (laminate)
  load.force_N                      between the reference and this image
then
  plychain loop {}\n",
        path.display()
    )
}

/// The measurement of a DIC export, with what was assumed about it.
fn propose(csv: &Path, specimen: &mut Value) -> Result<(Value, String)> {
    let header = table::header(csv)?;
    let known: Vec<&str> = MAPPINGS.iter().map(|m| m.program).collect();
    let in_pixels = |columns: &str| {
        Error::input(
            format!("--csv {}", csv.display()),
            "calibrated columns, in a unit of length",
        )
        .found(format!("{columns} in pixels"))
        .hint("export the field with its calibration")
    };
    let found = matching(&header).ok_or_else(|| {
        let unit = |h: &&String| {
            let name = h.to_lowercase();
            ["[px]", "(px)", "_px", "pixel"]
                .iter()
                .any(|unit| name.contains(unit))
        };
        if let Some(column) = header.iter().find(unit) {
            return in_pixels(&format!("the column {column}"));
        }
        let place = format!("--csv {}", csv.display());
        let expected = format!("columns as one of these writes them: {}", shortened(&known));
        Error::input(place, expected)
            .found(header.join(", "))
            .hint("one unit for both coordinates and one for both displacements; or leave --csv out, and name the columns x, y, ux, uy in measurement.columns")
    })?;
    let [Some(coordinates), Some(displacements)] = found.units else {
        let [x, y, ux, uy] = &found.columns;
        let [a, b] = found.units[0].map_or([x, y], |_| [ux, uy]);
        return Err(in_pixels(&format!("the columns {a}, {b}")));
    };
    let [x, y, ux, uy] = found.columns.clone();
    let units = Units {
        coordinates: coordinates.into(),
        displacements: displacements.into(),
    };
    let frame = Frame {
        loading_axis: Axis::X,
        hole_center_mm: [0.0, 0.0],
    };
    let columns = Columns { x, y, ux, uy };
    let field = table::read(csv, &ColumnMap { columns, units }, frame)?;
    let along = loading_axis(&field);
    let hole = hole(&field);
    let extent = field.bounds();
    let mut said = format!(
        "\nread from {}: {} points, columns of {}, coordinates in {coordinates} and displacements in {displacements}\nproposed, to be checked:\n  loading_axis \"{along}\" (the larger stretch; the load pulls along it)\n",
        csv.display(),
        field.len(),
        found.program
    );
    let centre = match hole {
        Some((centre, diameter)) => {
            let _ = writeln!(
                said,
                "  hole_center_in_data_mm [{:.2}, {:.2}] and hole.diameter_mm {diameter:.1} (a circle about the largest gap in the points; the true hole is a little smaller)",
                centre[0], centre[1]
            );
            specimen["hole"]["diameter_mm"] = json!(round(diameter, 1));
            centre
        }
        None => {
            said += "  hole_center_in_data_mm: no gap in the points looks like a hole; the middle of the points is taken\n";
            [0, 1].map(|k| 0.5 * (extent[0][k] + extent[1][k]))
        }
    };
    let _ = writeln!(
        said,
        "  the points span x {:.2} to {:.2} and y {:.2} to {:.2} mm; the model is rigid-motion free over them, with rigid_translation and rigid_rotation declared",
        extent[0][0], extent[1][0], extent[0][1], extent[1][1]
    );
    if field.points.iter().flatten().all(|x| x.fract() == 0.0) {
        said += "  every coordinate is a whole number, as pixels are: if they are not mm, export the field with its calibration\n";
    }
    let measurement = json!({
        "format": "csv",
        "file": csv,
        "columns": { "x": found.columns[0], "y": found.columns[1], "ux": found.columns[2], "uy": found.columns[3] },
        "units": { "coordinates": coordinates, "displacements": displacements },
        "loading_axis": along,
        "hole_center_in_data_mm": centre.map(|v| round(v, 2)),
    });
    Ok((measurement, said))
}

fn round(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

fn shortened(names: &[&str]) -> String {
    let mut short: Vec<&str> = Vec::new();
    for name in names {
        let name = name.split(" (").next().unwrap_or(name);
        if !short.contains(&name) {
            short.push(name);
        }
    }
    short.join(", ")
}

/// The axis of the larger mean strain (points and displacements in the data's own axes).
fn loading_axis(field: &Field) -> &'static str {
    let strain = |k: usize| {
        let n = field.len() as f64;
        let mean = |f: &dyn Fn(usize) -> f64| (0..field.len()).map(f).sum::<f64>() / n;
        let (x, u) = (
            mean(&|i| field.points[i][k]),
            mean(&|i| field.displacement[i][k]),
        );
        let xu = mean(&|i| (field.points[i][k] - x) * (field.displacement[i][k] - u));
        let xx = mean(&|i| (field.points[i][k] - x).powi(2));
        (xu / xx.max(f64::MIN_POSITIVE)).abs()
    };
    if strain(1) > strain(0) { "y" } else { "x" }
}

/// Share of the measured rectangle that a gap must at least cover to be a hole.
const SMALLEST_GAP: f64 = 0.003;

/// Centre and diameter of the largest gap in the points that does not touch their border.
fn hole(field: &Field) -> Option<([f64; 2], f64)> {
    let cells = FieldCells::new(&field.points);
    let (columns, rows) = (cells.x.len(), cells.y.len());
    if columns < 5 || rows < 5 {
        return None;
    }
    let mut empty = vec![true; cells.len()];
    cells.of_point.iter().for_each(|&c| empty[c] = false);
    let mut best: Vec<usize> = Vec::new();
    for start in 0..cells.len() {
        if !empty[start] {
            continue;
        }
        let (mut gap, mut inside) = (Vec::new(), true);
        let mut todo = vec![start];
        empty[start] = false;
        while let Some(cell) = todo.pop() {
            gap.push(cell);
            let (i, j) = (cell % columns, cell / columns);
            if i == 0 || j == 0 || i + 1 == columns || j + 1 == rows {
                inside = false;
                continue;
            }
            for next in [cell - 1, cell + 1, cell - columns, cell + columns] {
                if std::mem::take(&mut empty[next]) {
                    todo.push(next);
                }
            }
        }
        if inside && gap.len() > best.len() {
            best = gap;
        }
    }
    if (best.len() as f64) < SMALLEST_GAP * cells.len() as f64 {
        return None;
    }
    let n = best.len() as f64;
    let centre = [
        best.iter().map(|c| cells.x[c % columns]).sum::<f64>() / n,
        best.iter().map(|c| cells.y[c / columns]).sum::<f64>() / n,
    ];
    Some(circle(&field.points, centre))
}

/// Directions in which the hole's rim is sought.
const SECTORS: usize = 36;

/// The circle through the points next to a gap, by least squares (Kasa 1976): centre and diameter. The nearest point in each
/// direction stands for the rim.
fn circle(points: &[[f64; 2]], start: [f64; 2]) -> ([f64; 2], f64) {
    let (mut centre, mut diameter) = (start, 0.0);
    for _ in 0..5 {
        let mut rim: Vec<Option<(f64, [f64; 2])>> = vec![None; SECTORS];
        for p in points {
            let [x, y] = [p[0] - centre[0], p[1] - centre[1]];
            let turn = y.atan2(x) / std::f64::consts::TAU + 0.5;
            let sector = ((turn * SECTORS as f64) as usize).min(SECTORS - 1);
            let r = x.hypot(y);
            if rim[sector].is_none_or(|(nearest, _)| r < nearest) {
                rim[sector] = Some((r, [x, y]));
            }
        }
        // x^2 + y^2 = a x + b y + c
        let mut normal = nalgebra::Matrix3::zeros();
        let mut right = nalgebra::Vector3::zeros();
        for (r, [x, y]) in rim.into_iter().flatten() {
            let row = nalgebra::Vector3::new(x, y, 1.0);
            normal += row * row.transpose();
            right += r * r * row;
        }
        let Some(fit) = normal.cholesky().map(|c| c.solve(&right)) else {
            break;
        };
        let [a, b] = [0.5 * fit[0], 0.5 * fit[1]];
        centre = [centre[0] + a, centre[1] + b];
        diameter = 2.0 * (fit[2] + a * a + b * b).max(0.0).sqrt();
    }
    (centre, diameter)
}
