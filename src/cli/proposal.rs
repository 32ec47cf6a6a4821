//! The measurement, the hole and the plate that `init` proposes from tables of displacements.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::exports;
use super::points::{hole, loading_axis, strain};
use super::proposed::{Export, quality};
use super::table_options::{TableArguments, TableOptions};
use crate::error::{Error, Result};
use crate::field::programs::FoundUnit;
use crate::field::{ColumnMap, Columns, Field, PIXEL, Units, bounds, conventions, table};

/// What a key has that is not settled: no verb takes it.
pub const OPEN: &str = "?";

/// What was made of tables.
pub struct ModelProposal {
    /// What was assumed.
    pub said: String,
    /// The field of the largest strain in the data's own axes.
    pub field: Field,
    /// The files that are used, in the order of the steps.
    pub files: Vec<PathBuf>,
}

/// Put the measurement of one DIC export, or of a series of them, into the experiment.
///
/// # Errors
/// Of the input: a table that cannot be read, or something that it does not tell.
pub fn propose(
    files: &[PathBuf],
    arguments: &TableArguments,
    is_meshed: bool,
    experiment: &mut Value,
) -> Result<ModelProposal> {
    let exports = read_all(files, arguments)?;
    let mut said = String::new();
    let still = |e: &Export| e.field.displacement.iter().flatten().all(|u| *u == 0.0);
    let mut kept: Vec<(PathBuf, Export)> = Vec::new();
    for (file, export) in files.iter().zip(exports) {
        if still(&export) && files.len() > 1 {
            let _ = writeln!(
                said,
                "  {} is the reference picture itself, all displacements are 0: left out",
                file.display()
            );
        } else {
            kept.push((file.clone(), export));
        }
    }
    if kept.is_empty() {
        return Err(Error::input("--csv", "a table of a loaded state")
            .found("displacements that are all 0, as those of the reference picture"));
    }
    let (files, mut exports): (Vec<PathBuf>, Vec<Export>) = kept.into_iter().unzip();
    said += &before_deformation(&mut exports);
    let strained = |k: &usize| strain(&exports[*k].field).into_iter().fold(0.0, f64::max);
    let largest = (0..files.len()).max_by(|a, b| strained(a).total_cmp(&strained(b)));
    let chosen = largest.unwrap_or(0);
    let specimen = Some(&mut experiment["specimen"]).filter(|_| !is_meshed);
    let (measurement, proposed) =
        measurement(&files[chosen], &exports, chosen, arguments, specimen);
    experiment["measurement"] = measurement;
    let (files, of_files) = put(&files, experiment)?;
    Ok(ModelProposal {
        said: proposed + &said + &of_files,
        field: exports.swap_remove(chosen).field,
        files,
    })
}

/// Put the file, or the steps, into an experiment with its measurement; returns the files in their order.
fn put(files: &[PathBuf], experiment: &mut Value) -> Result<(Vec<PathBuf>, String)> {
    let mut said = String::new();
    if let [file] = files {
        experiment["measurement"]["file"] = json!(file);
        let stated = table::stated_force(file)?;
        let by = match stated {
            Some(_) => "stated in the file; N if it says no unit",
            None => "by the file's name",
        };
        if let Some(force) = stated.or_else(|| exports::force_in_name(file).filter(|f| *f != 0.0)) {
            experiment["load"]["force_N"] = json!(force);
            let _ = writeln!(said, "  load.force_N {force}: {by}");
        }
        return Ok((files.to_vec(), said));
    }
    let (steps, of_steps) = exports::steps(files)?;
    experiment["steps"] = json!(steps);
    if let Some(experiment) = experiment.as_object_mut() {
        experiment.remove("load");
    }
    Ok((steps.into_iter().map(|s| s.file).collect(), of_steps))
}

/// Put what a first look at the files tells into the experiment, and [`OPEN`] for the rest.
///
/// # Errors
/// Of the input: options that say nothing, a file that is no table.
pub fn draft(files: &[PathBuf], arguments: &TableArguments, experiment: &mut Value) -> Result<()> {
    let user = TableOptions::of(arguments)?;
    let header = table::described(&files[0], &[])?;
    let found = &header.found;
    let program = found.as_ref().map(|f| f.program);
    let (sigma, correlation) = quality(&header.names, program, &user);
    let mut columns = match (user.columns, found) {
        (Some(columns), _) => columns,
        (None, Some(found)) => Columns::new(found.columns.clone()),
        (None, None) => Columns::new([OPEN; 4].map(String::from)),
    };
    // a habit of the program is what may be wrong
    let unit = |k: usize| match (user.units, found.as_ref().map(|f| f.units[k])) {
        (Some(units), _) => units[k],
        (_, Some(FoundUnit::Stated(unit) | FoundUnit::Usual(unit @ PIXEL))) => unit,
        _ if user.mm_per_pixel.is_some() => PIXEL,
        _ => OPEN,
    };
    let mut units = Units::new(unit(0), unit(1));
    if let Some((name, unit)) = sigma {
        units.sigma = unit.map(String::from);
        columns.sigma = Some(name);
    }
    columns.correlation = correlation;
    units.mm_per_pixel = user.mm_per_pixel;
    experiment["measurement"] = json!({
        "format": "csv",
        "columns": columns,
        "units": units,
        "loading_axis": OPEN,
        "hole_center_in_data_mm": [0.0, 0.0],
    });
    put(files, experiment).map(|_| ())
}

/// The tables, whose columns and units are one.
fn read_all(files: &[PathBuf], arguments: &TableArguments) -> Result<Vec<Export>> {
    let user = TableOptions::of(arguments)?;
    let read: Vec<Result<Export>> = files
        .par_iter()
        .map(|file| Export::read(file, &user))
        .collect();
    let count = read.iter().filter(|r| r.is_ok()).count();
    let alone = |error: Error| match error.hint_text().map(String::from) {
        Some(hint) if count > 0 => error.hint(format!(
            "{hint}; {count} of {} files are read: or leave this one out",
            files.len()
        )),
        _ => error,
    };
    let read: Result<Vec<Export>> = read.into_iter().collect();
    let mut exports = read.map_err(alone)?;
    // a coefficient that is none in one step is none
    let correlated = exports.iter().all(|e| e.map.columns.correlation.is_some());
    let scale = exports[0].map.units.mm_per_pixel;
    for export in &mut exports {
        if !correlated {
            export.map.columns.correlation = None;
        }
        if export.map.units.mm_per_pixel.is_some() {
            export.map.units.mm_per_pixel = scale;
        }
    }
    match (1..files.len()).find(|&k| exports[k].map != exports[0].map) {
        None => Ok(exports),
        Some(odd) => {
            let expected = format!("the columns and units of {}", files[0].display());
            Err(Error::input(files[odd].display(), expected)
                .found(table::header(&files[odd])?.join(", "))
                .hint("export all steps alike"))
        }
    }
}

/// Take the places of the fields back to the reference picture, if they are those of the deformed state.
fn before_deformation(exports: &mut [Export]) -> String {
    let fields: Vec<Field> = exports.iter().map(|e| e.field.clone()).collect();
    let by_data = conventions::is_deformed(&fields);
    let (deformed, why) = match by_data {
        Some(deformed) => (deformed, "the reference places of all points are one grid"),
        None => (exports[0].usually_deformed, "as its program writes them"),
    };
    if !deformed {
        return String::new();
    }
    let names = exports[0].map.columns.named();
    let [x, y, ux, uy] = [0, 1, 2, 3].map(|k| names[k].1);
    let said = format!(
        "  columns.deformed true: {x}, {y} are places in the deformed state ({why}); the reference is {x} - {ux}, {y} - {uy}\n"
    );
    for export in exports {
        export.map.columns.deformed = true;
        export.field = conventions::before_deformation(export.field.clone());
    }
    said
}

/// The measurement without its files, and what was assumed about it; hole and size of the plate go into the specimen.
fn measurement(
    csv: &Path,
    exports: &[Export],
    chosen: usize,
    arguments: &TableArguments,
    specimen: Option<&mut Value>,
) -> (Value, String) {
    let Export {
        label, map, field, ..
    } = &exports[chosen];
    let along = loading_axis(field);
    let fields: Vec<Field> = exports.iter().map(|e| e.field.clone()).collect();
    let points = conventions::all_points(&fields);
    let extent = bounds(&points);
    let Units {
        coordinates,
        displacements,
        ..
    } = &map.units;
    let mut said = format!(
        "\nread from {}: {} points, columns of {label}, coordinates in {coordinates} and displacements in {displacements}\n{}proposed, to be checked:\n  loading_axis \"{along}\" (the larger stretch; the load pulls along it)\n",
        csv.display(),
        field.len(),
        exports[chosen].said,
    );
    let images = images(&exports[chosen], arguments, &mut said);
    let subset = images.as_ref().and_then(|i| i["subset_mm"].as_f64());
    let found = hole(&points).map(|(centre, gap)| {
        let diameter = beside_subsets(gap, subset.unwrap_or(0.0).min(0.4 * gap));
        // of a hole below a millimetre a decimal would be nothing
        let diameter = round(diameter, if diameter < 1.0 { 3 } else { 1 });
        let _ = writeln!(
            said,
            "  hole_center_in_data_mm [{:.2}, {:.2}] and hole.diameter_mm {diameter:?} (by the points that the largest gap lacks; measure the hole)",
            centre[0], centre[1]
        );
        (centre, diameter)
    });
    let centre = found.map_or_else(
        || {
            said += "  hole_center_in_data_mm: no gap in the points looks like a hole; the middle of the points is taken\n";
            [0, 1].map(|k| 0.5 * (extent[0][k] + extent[1][k]))
        },
        |(centre, _)| centre,
    );
    if let Some(specimen) = specimen {
        let reach = [0, 1].map(|k| (extent[1][k] - centre[k]).max(centre[k] - extent[0][k]));
        let [along, across] = if along == "y" {
            [reach[1], reach[0]]
        } else {
            reach
        };
        said += &plate(
            specimen,
            found.map(|(_, diameter)| diameter),
            [along, across],
        );
    }
    let _ = writeln!(
        said,
        "  the points span x {:.2} to {:.2} and y {:.2} to {:.2} mm; the model is rigid-motion free over them, with rigid_translation and rigid_rotation declared",
        extent[0][0], extent[1][0], extent[0][1], extent[1][1]
    );
    said += &remarks(map, field);
    let mut measurement = json!({
        "format": "csv",
        "columns": map.columns,
        "units": map.units,
        "loading_axis": along,
        "hole_center_in_data_mm": centre.map(|v| round(v, 2)),
    });
    if let Some(images) = images {
        measurement["image_correlation"] = images;
    }
    (measurement, said)
}

/// What is odd about a field, each with what to change.
fn remarks(map: &ColumnMap, field: &Field) -> String {
    let mut said = String::new();
    let unit = map.units.in_mm().map_or(1.0, |[mm, _]| mm);
    if map.units.coordinates != PIXEL && conventions::is_of_pixels(field, unit) {
        said += "  every coordinate is a whole number on a grid, as pixels are: if they are not in the unit above, give --mm-per-pixel or export the field with its calibration\n";
    }
    if field.displacement.iter().flatten().all(|u| *u == 0.0) {
        said += "  all displacements are 0: the reference picture itself? take the table of a loaded state\n";
    }
    for odd in conventions::odd(field, [&map.columns.y, &map.columns.ux, &map.columns.uy]) {
        let _ = writeln!(said, "  {odd}");
    }
    said
}

/// How the images were correlated, as the user or the file says.
fn images(export: &Export, arguments: &TableArguments, said: &mut String) -> Option<Value> {
    let given = arguments.subset_px.or(export.subset_px);
    let given = given.filter(|_| arguments.subset_mm.is_none());
    let subset = match (given, export.pixel_mm) {
        (Some(px), Some(mm)) => {
            let by = if arguments.subset_px.is_some() {
                "--subset-px"
            } else {
                "the file"
            };
            let _ = writeln!(
                said,
                "  image_correlation.subset_mm {:.4}: subsets of {px} px, as {by} says",
                px * mm
            );
            Some(round(px * mm, 6))
        }
        (Some(px), None) => {
            let _ = writeln!(
                said,
                "  the file says subsets of {px} px: give their side in mm with --subset-mm"
            );
            None
        }
        (None, _) => arguments.subset_mm,
    }?;
    let mut images = arguments.images(subset);
    if let Some(size) = export.pixel_mm {
        images["pixel_mm"] = json!(round(size, 9));
    }
    Some(images)
}

/// The specimen has the hole that the points show, and is at least as long and as wide as they and the hole need; `reach` is how far
/// points lie from its centre along the load and across it.
fn plate(specimen: &mut Value, hole: Option<f64>, reach: [f64; 2]) -> String {
    /// A ligament beside the hole, as a share of its diameter.
    const LIGAMENT: f64 = 0.1;
    let mut said = String::new();
    match (hole, specimen.as_object_mut()) {
        (Some(diameter), _) => specimen["hole"]["diameter_mm"] = json!(diameter),
        (None, Some(specimen)) => {
            specimen.remove("hole");
            said += "  specimen.hole is left out: write it in if the specimen has a hole that the points do not show\n";
        }
        (None, None) => {}
    }
    let diameter = hole.unwrap_or(0.0);
    for (key, reach) in ["length_mm", "width_mm"].into_iter().zip(reach) {
        let needed = (2.0 * reach).max((1.0 + 2.0 * LIGAMENT) * diameter).ceil();
        let template = specimen[key].as_f64().unwrap_or(0.0);
        if needed > template {
            specimen[key] = json!(needed);
            let _ = writeln!(
                said,
                "  specimen.{key} {needed}: the points and the hole need it, {template} is the template's; measure the plate"
            );
        }
    }
    said
}

pub(super) fn round(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

/// The diameter of a hole about which subsets of a side lie on the specimen altogether, from that of the gap in them: the area of a disc with a
/// square moved over it is pi r^2 + 4 r side + side^2.
fn beside_subsets(gap: f64, side: f64) -> f64 {
    let pi = std::f64::consts::PI;
    let area = 0.25 * pi * gap * gap - side * side;
    let root = (4.0 * side * side + pi * area).max(0.0).sqrt();
    2.0 * (root - 2.0 * side) / pi
}
