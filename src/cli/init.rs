//! `plychain init`: a model file to start from, for one's own specimen.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::forces::ForceArguments;
use super::print;
use super::proposal::{ModelProposal, OPEN, draft, propose};
use super::table_options::TableArguments;
use super::{examples, exports, meshes};
use crate::effect::{EFFECTS, Effect};
use crate::error::{Error, Result};
use crate::field::Series;
use crate::files;
use crate::infer::{Model, OPENHOLE, STEEL};

/// Arguments of `init`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain init                                   a carbon/epoxy laminate, to be edited
  plychain init --example two-holes               an example that comes with the program, with its data
  plychain init strip --like steel                a copy of the steel strip's model
  plychain init strip --like steel --csv field.csv    columns, hole and axis read from a DIC export
  plychain init coupon --csv 'step-*.csv' --subset-mm 1 --camera-distance-mm 500
                                                  the same of a load series, one file a step
  plychain init plate --mesh plate.msh --csv field.csv    a specimen of any shape; plate-mesh.svg shows mesh and points")]
pub struct InitArguments {
    /// Name of the model; the file is NAME.json
    #[arg(default_value = "specimen")]
    name: String,
    /// Write an example that comes with the program, with its data, in place of a model to edit: openhole, plate, openhole-and-plate,
    /// two-holes, oblique, iosipescu, disc, steel-s235 or openhole-calculix
    #[arg(long, value_name = "EXAMPLE", conflicts_with_all = ["name", "like", "csv", "mesh"])]
    example: Option<String>,
    /// The model to start from
    #[arg(long, value_enum, default_value = "openhole")]
    like: Like,
    /// DIC export to read the columns, the loading axis and the hole from. Several files, or a pattern in quotation marks, are the steps of a
    /// load series
    #[arg(long, value_name = "FILE", num_args = 1..)]
    csv: Vec<PathBuf>,
    /// Mesh of Gmsh, Abaqus or NASTRAN, in place of the plate's dimensions. init proposes frame, loads and supports, and draws mesh, named edges
    /// and measured points in NAME-mesh.svg
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    #[command(flatten)]
    tables: TableArguments,
    #[command(flatten)]
    forces: ForceArguments,
}

/// The models that come with the program.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Like {
    /// The laminate of the open-hole test
    Openhole,
    /// The isotropic strip
    Steel,
}

impl Like {
    fn text(self) -> &'static str {
        match self {
            Self::Openhole => OPENHOLE.text,
            Self::Steel => STEEL.text,
        }
    }
}

pub fn run(arguments: &InitArguments) -> Result<()> {
    match &arguments.example {
        Some(name) => example(name),
        None => begun(arguments),
    }
}

/// Write an example with its data.
fn example(name: &str) -> Result<()> {
    let example = examples::find(name)?;
    let path = example.write(Path::new(""))?;
    let run = format!("then\n  plychain loop {}\n", path.display());
    print(&(example.said(&path) + &run))
}

/// Write a model to be edited.
fn begun(arguments: &InitArguments) -> Result<()> {
    let path = free(arguments)?;
    let mut model = template(arguments)?;
    let experiment = &mut model["experiments"][0];
    let files = exports::expand(&arguments.csv)?;
    let (mut said, mut field, mut question, mut count) = (String::new(), None, None, files.len());
    if files.is_empty() {
        experiment["measurement"] = unread();
    } else {
        match tables(arguments, &files, experiment) {
            Ok(proposal) => {
                said += &proposal.said;
                field = Some(proposal.field);
                count = proposal.files.len();
            }
            Err(error) if is_open(experiment) => question = Some(error),
            Err(error) => return Err(error),
        }
    }
    if let Some(mesh) = arguments.mesh.as_ref().filter(|_| question.is_none()) {
        said += &meshes::propose(mesh, field.as_ref(), experiment)?;
    }
    if let Some(subset) = arguments.tables.subset_mm.filter(|_| field.is_none()) {
        experiment["measurement"]["image_correlation"] = arguments.tables.images(subset);
    }
    let mut text = serde_json::to_string_pretty(&model)
        .map_err(|e| Error::program("model", "values that JSON can hold").found(e))?;
    text.push('\n');
    files::replace(&path, &text)?;
    if let Some(question) = question {
        print(&format!("{} written\n{OPEN_SAID}", path.display()))?;
        return Err(question);
    }
    match &Model::parse(&text, &path) {
        Ok(model) => {
            if arguments.mesh.is_some() {
                let picture = PathBuf::from(format!("{}-mesh.svg", arguments.name));
                said += &meshes::draw(model, field.as_ref(), &picture)?;
            }
            said += &series(model);
            if let (None, 1, Err(error)) = (&arguments.mesh, count, model.read_field()) {
                said += &unsettled(&error);
            }
        }
        Err(error) => said += &unsettled(error),
    }
    print(&format!(
        "{} written\n{said}{}",
        path.display(),
        next(&path, count > 1, arguments.mesh.is_some())
    ))
}

/// What is said of a file with open places.
const OPEN_SAID: &str = "  it has \"?\" where the tables do not say what is right, and every verb refuses it until that is edited\n  or answer the question below and run init again: the file of open places is then kept as NAME.json.old\n";

/// The file to write, which is not there yet, or has open places and is put aside.
fn free(arguments: &InitArguments) -> Result<PathBuf> {
    let path = PathBuf::from(format!("{}.json", arguments.name));
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    if arguments.name.is_empty() || !arguments.name.chars().all(plain) {
        return Err(Error::input("NAME", "letters, digits, - _ .").found(&arguments.name));
    }
    let there = std::fs::read_to_string(&path).ok();
    let there = there.and_then(|text| serde_json::from_str::<Value>(&text).ok());
    if there.is_some_and(|model| is_open(&model["experiments"][0])) {
        let old = path.with_extension("json.old");
        std::fs::rename(&path, &old)
            .map_err(|e| Error::input(old.display(), "a place for the open file").found(e))?;
    } else if path.exists() {
        return Err(
            Error::input(path.display(), "a file that does not exist yet")
                .found("an existing one")
                .hint("give another name: plychain init NAME"),
        );
    }
    Ok(path)
}

/// Whether the measurement or a force of an experiment is not settled.
fn is_open(experiment: &Value) -> bool {
    let steps = experiment["steps"].as_array().into_iter().flatten();
    let mut forces = steps.chain([&experiment["load"]]).map(|s| &s["force_N"]);
    forces.any(|force| force == OPEN) || experiment["measurement"]["loading_axis"] == OPEN
}

/// What the tables and the file of forces tell; what they do not stays open in the experiment.
fn tables(
    arguments: &InitArguments,
    files: &[PathBuf],
    experiment: &mut Value,
) -> Result<ModelProposal> {
    let is_meshed = arguments.mesh.is_some();
    let mut proposal = match propose(files, &arguments.tables, is_meshed, experiment) {
        Ok(proposal) => proposal,
        Err(error) => {
            // options that say nothing are not written down
            let place = error.to_string();
            if place.starts_with("--csv") || !place.starts_with("--") {
                let _ = draft(files, &arguments.tables, experiment);
            }
            return Err(error);
        }
    };
    match arguments.forces.apply(&proposal.files, experiment) {
        Ok(forces) => {
            proposal.said += &forces;
            Ok(proposal)
        }
        Err(error) => {
            match experiment.get_mut("steps").and_then(Value::as_array_mut) {
                Some(steps) => steps.iter_mut().for_each(|s| s["force_N"] = json!(OPEN)),
                None => experiment["load"]["force_N"] = json!(OPEN),
            }
            Err(error)
        }
    }
}

/// The model to start from, with what is the same for everybody.
fn template(arguments: &InitArguments) -> Result<Value> {
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
    Ok(model)
}

/// What has to be put right in the file before anything else.
fn unsettled(error: &Error) -> String {
    let error = with_hint(error);
    format!("  not settled, and refused by every verb until it is edited: {error}\n")
}

fn with_hint(error: &Error) -> String {
    match error.hint_text() {
        Some(hint) => format!("{error} ({hint})"),
        None => error.to_string(),
    }
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
            let error = with_hint(&error);
            format!("  the steps cannot be read as a series yet: {error}\n")
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
