//! `plychain init`: a model file to start from, for one's own specimen.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::mappings::{MAPPINGS, MatchedMapping, matching, quality};
use super::points::{hole, loading_axis, strain};
use super::print;
use super::{exports, meshes};
use crate::effect::{EFFECTS, Effect};
use crate::error::{Error, Result};
use crate::field::{
    Axis, ColumnMap, Columns, Field, Frame, LEAST_CORRELATION, PIXEL, Series, Units, table,
};
use crate::files;
use crate::infer::Model;

/// Arguments of `init`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain init                                   a carbon/epoxy laminate, to be edited
  plychain init strip --like steel                a copy of the steel strip's model
  plychain init strip --like steel --csv field.csv    columns, hole and axis read from a DIC export
  plychain init coupon --csv 'step-*.csv' --subset-mm 1 --camera-distance-mm 500
                                                  the same of a load series, one file a step
  plychain init plate --mesh plate.msh --csv field.csv    a specimen of any shape; plate-mesh.svg shows mesh and points")]
pub struct InitArguments {
    /// Name of the model; the file is NAME.json
    #[arg(default_value = "specimen")]
    name: String,
    /// The model to start from
    #[arg(long, value_enum, default_value = "openhole")]
    like: Like,
    /// A DIC export: its columns are mapped, and the hole and the loading axis proposed from it. Several files, or a pattern in
    /// quotation marks, are the steps of a load series
    #[arg(long, value_name = "FILE", num_args = 1..)]
    csv: Vec<PathBuf>,
    /// A mesh of Gmsh or Abaqus in place of the plate's dimensions: its frame, loads and supports are proposed, and NAME-mesh.svg shows
    /// mesh, named edges and measured points
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Size of a pixel on the specimen, for exports in pixels
    #[arg(long, value_name = "MM", requires = "csv")]
    mm_per_pixel: Option<f64>,
    /// Side of the subsets of the image correlation
    #[arg(long, value_name = "MM")]
    subset_mm: Option<f64>,
    /// Distance of the camera from the specimen
    #[arg(long, value_name = "MM", requires = "subset_mm")]
    camera_distance_mm: Option<f64>,
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

pub fn run(arguments: &InitArguments) -> Result<()> {
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
    let is_rigid = |effect: &&&dyn Effect| effect.is_rigid();
    let rigid_motion: Vec<_> = EFFECTS.iter().filter(is_rigid).map(|e| e.name()).collect();
    experiment["effects"] = json!(rigid_motion);
    experiment["gauge"] = json!("window");
    experiment["specimen"]["note"] =
        json!("dimensions in mm; hole.center_mm from the plate's centre, (along the load, across)");
    if let Some(specimen) = experiment["specimen"].as_object_mut() {
        // The clamp is the rig's of that test, and no part of another.
        specimen.remove("clamp");
    }
    let files = exports::expand(&arguments.csv)?;
    let (mut said, field) = if files.is_empty() {
        experiment["measurement"] = unread();
        (String::new(), None)
    } else {
        let (said, field) = propose(&files, arguments, experiment)?;
        (said, Some(field))
    };
    if let Some(mesh) = &arguments.mesh {
        said += &meshes::propose(mesh, field.as_ref(), experiment)?;
    }
    if let Some(subset) = arguments.subset_mm {
        let mut images = json!({ "subset_mm": subset });
        if let Some(distance) = arguments.camera_distance_mm {
            images["camera_distance_mm"] = json!(distance);
        }
        experiment["measurement"]["image_correlation"] = images;
    }
    if let Some(reduced) = model["reduced_model"].as_object_mut() {
        reduced.remove("reference");
    }
    let mut text = serde_json::to_string_pretty(&model)
        .map_err(|e| Error::program("model", "values that JSON can hold").found(e))?;
    text.push('\n');
    let model = Model::parse(&text, &path)?;
    files::replace(&path, text)?;
    if arguments.mesh.is_some() {
        let picture = PathBuf::from(format!("{}-mesh.svg", arguments.name));
        said += &meshes::draw(&model, field.as_ref(), &picture)?;
    }
    print(&format!(
        "{} written\n{said}{}{}",
        path.display(),
        series(&model),
        next(&path, files.len() > 1, arguments.mesh.is_some())
    ))
}

/// What the steps have in common, or why they are no series.
fn series(model: &Model) -> String {
    match model.read_series() {
        Ok(None) => String::new(),
        Ok(Some(Series {
            field,
            steps,
            warnings,
            ..
        })) => {
            let mut said = format!(
                "  {} steps with {} points in common, after {} outliers\n",
                steps.len(),
                field.len(),
                field.rejected.outliers
            );
            for warning in warnings {
                let _ = writeln!(said, "  {warning}");
            }
            said
        }
        Err(error) => {
            let hint = error
                .hint_text()
                .map_or_else(String::new, |h| format!(" ({h})"));
            format!("  the steps cannot be read as a series yet: {error}{hint}\n")
        }
    }
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
fn next(path: &Path, is_series: bool, is_meshed: bool) -> String {
    let shape = if is_meshed {
        "mesh.load, mesh.supports          the edges on which the force acts, and those that are held"
    } else {
        "specimen.length_mm, width_mm      the plate between the grips
  specimen.hole                     diameter, and place from the plate's centre"
    };
    let images = if is_series {
        "
  measurement.image_correlation     subset_mm, camera_distance_mm, pixel_mm (image correlation)"
    } else {
        ""
    };
    let force = if is_series {
        "steps[].force_N                   where it is not right above: between the reference and each image; null if unknown"
    } else {
        "load.force_N                      between the reference and this image"
    };
    format!(
        "\nto be edited before the first run, because no file of displacements says it:
  material.parameters               priors: what is known of the constants beforehand
and of the experiment
  {shape}
  specimen.layup_deg, thickness_mm  (laminate)
  {force}{images}
then
  plychain loop {}\n",
        path.display()
    )
}

/// The diameter of a hole about which subsets of a side lie on the specimen altogether, from that of the gap in them: the area of a disc with a
/// square moved over it is pi r^2 + 4 r side + side^2.
fn beside_subsets(gap: f64, side: f64) -> f64 {
    let pi = std::f64::consts::PI;
    let area = 0.25 * pi * gap * gap - side * side;
    let root = (4.0 * side * side + pi * area).max(0.0).sqrt();
    2.0 * (root - 2.0 * side) / pi
}

/// An export as it is read.
struct Export {
    program: &'static str,
    map: ColumnMap,
    field: Field,
    /// What was assumed of its columns.
    said: String,
}

/// Put the measurement of one DIC export, or of a series of them, into the experiment; returns what was assumed about it, and the field
/// of the largest strain in the data's own axes.
fn propose(
    files: &[PathBuf],
    arguments: &InitArguments,
    experiment: &mut Value,
) -> Result<(String, Field)> {
    let mut exports = files
        .iter()
        .map(|file| Export::read(file, arguments.mm_per_pixel))
        .collect::<Result<Vec<Export>>>()?;
    if let Some(odd) = (1..files.len()).find(|&k| exports[k].map != exports[0].map) {
        let expected = format!("the columns and units of {}", files[0].display());
        return Err(Error::input(files[odd].display(), expected)
            .found(table::header(&files[odd])?.join(", "))
            .hint("export all steps alike"));
    }
    let strained = |k: &usize| strain(&exports[*k].field).into_iter().fold(0.0, f64::max);
    let largest = (0..files.len()).max_by(|a, b| strained(a).total_cmp(&strained(b)));
    let chosen = largest.unwrap_or(0);
    let export = &exports[chosen];
    let specimen = &mut experiment["specimen"];
    let (mut measurement, mut said) = export.propose(&files[chosen], arguments.subset_mm, specimen);
    if let [file] = files {
        measurement["file"] = json!(file);
        if let Some(force) = table::stated_force(file)? {
            experiment["load"]["force_N"] = json!(force);
            let _ = writeln!(
                said,
                "  load.force_N {force}: stated in the file; N if it says no unit"
            );
        }
    } else {
        let (steps, of_steps) = exports::steps(files)?;
        experiment["steps"] = json!(steps);
        if let Some(experiment) = experiment.as_object_mut() {
            experiment.remove("load");
        }
        said += &of_steps;
    }
    experiment["measurement"] = measurement;
    Ok((said, exports.swap_remove(chosen).field))
}

impl Export {
    fn read(csv: &Path, mm_per_pixel: Option<f64>) -> Result<Self> {
        let header = table::header(csv)?;
        let found = recognised(csv, &header, mm_per_pixel.is_some())?;
        let [coordinates, displacements] = found.units.map(|unit| unit.unwrap_or(PIXEL));
        let mut units = Units::new(coordinates, displacements);
        let mut columns = Columns::new(found.columns);
        let mut said = String::new();
        let (sigma, correlation) = quality(&header, found.program);
        if let Some((name, unit)) = sigma {
            let _ = writeln!(
                said,
                "  sigma \"{name}\": points where it is not above 0 are dropped"
            );
            if unit == Some(PIXEL) && mm_per_pixel.is_none() {
                said += "    taken to be in pixels; with units.mm_per_pixel it is each point's standard deviation too\n";
            }
            units.sigma = unit.map(String::from);
            columns.sigma = Some(name);
        }
        let in_pixels =
            [coordinates, displacements].contains(&PIXEL) || units.sigma.as_deref() == Some(PIXEL);
        units.mm_per_pixel = mm_per_pixel.filter(|_| in_pixels);
        if coordinates == PIXEL {
            said += "  pixels: where y counts downwards in the picture, angles in the data's x-y plane turn clockwise in it\n";
        }
        let frame = Frame {
            loading_axis: Axis::X,
            hole_center_mm: [0.0, 0.0],
        };
        columns.correlation.clone_from(&correlation);
        let mut map = ColumnMap { columns, units };
        let mut read = table::read(csv, &map, frame);
        if let (Err(error), Some(name)) = (&read, correlation) {
            let _ = writeln!(said, "  \"{name}\" is not used: {error}");
            map.columns.correlation = None;
            read = table::read(csv, &map, frame);
        } else if let Some(name) = &map.columns.correlation {
            let _ = writeln!(
                said,
                "  correlation \"{name}\": points below {LEAST_CORRELATION} are dropped"
            );
        }
        Ok(Self {
            program: found.program,
            map,
            field: read?,
            said,
        })
    }

    /// The measurement without its files, and what was assumed about it; the hole's diameter goes into the specimen.
    fn propose(&self, csv: &Path, subset: Option<f64>, specimen: &mut Value) -> (Value, String) {
        let Self {
            program,
            map,
            field,
            ..
        } = self;
        let along = loading_axis(field);
        let extent = field.bounds();
        let Units {
            coordinates,
            displacements,
            ..
        } = &map.units;
        let mut said = format!(
            "\nread from {}: {} points, columns of {program}, coordinates in {coordinates} and displacements in {displacements}\n{}proposed, to be checked:\n  loading_axis \"{along}\" (the larger stretch; the load pulls along it)\n",
            csv.display(),
            field.len(),
            self.said,
        );
        let centre = match hole(field) {
            Some((centre, gap)) => {
                let diameter = beside_subsets(gap, subset.unwrap_or(0.0).min(0.4 * gap));
                let _ = writeln!(
                    said,
                    "  hole_center_in_data_mm [{:.2}, {:.2}] and hole.diameter_mm {diameter:.1} (by the points that the largest gap lacks; measure the hole)",
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
        let whole = field.points.iter().flatten().all(|x| x.fract() == 0.0);
        if whole && coordinates != PIXEL {
            said += "  every coordinate is a whole number, as pixels are: if they are not mm, export the field with its calibration\n";
        }
        let measurement = json!({
            "format": "csv",
            "columns": map.columns,
            "units": map.units,
            "loading_axis": along,
            "hole_center_in_data_mm": centre.map(|v| round(v, 2)),
        });
        (measurement, said)
    }
}

/// The columns of an export that hold a field; those in pixels only where their size is known.
fn recognised(csv: &Path, header: &[String], has_scale: bool) -> Result<MatchedMapping> {
    let known: Vec<&str> = MAPPINGS.iter().map(|m| m.program).collect();
    let in_pixels = |columns: &str| {
        Error::input(
            format!("--csv {}", csv.display()),
            "calibrated columns, in a unit of length",
        )
        .found(format!("{columns} in pixels"))
        .hint(
            "export the field with its calibration, or say the size of a pixel: --mm-per-pixel MM",
        )
    };
    let found = matching(header).ok_or_else(|| {
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
    if !has_scale && found.units.contains(&None) {
        let [x, y, ux, uy] = &found.columns;
        let [a, b] = found.units[0].map_or([x, y], |_| [ux, uy]);
        return Err(in_pixels(&format!("the columns {a}, {b}")));
    }
    Ok(found)
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
