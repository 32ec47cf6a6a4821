//! What `init` makes of a mesh file: its place in the data, its loads and supports, and a picture of all of it.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};

use super::points::hole;
use super::proposal::round;
use crate::error::{Error, Result};
use crate::field::Field;
use crate::files;
use crate::geometry::{HIGH, HOLE, LOW};
use crate::infer::Model;
use crate::mesh_files::{self, BoundaryEdge, Circle, ImportedMesh};
use crate::report::{mesh_figure, mesh_lines, on_mesh};

/// Data this many times as long as a mesh are in mm and the mesh is in metres.
const METRES: f64 = 30.0;

/// Points may lie beyond the mesh's bounds by this share of them, where both have one frame.
const BEYOND: f64 = 0.02;

/// A gap in the points is where the mesh has its circle if their centres are this close, as a share of the radius: points about a hole
/// tell its centre no better.
const SAME_PLACE: f64 = 0.2;

/// The edge's points are at an end if they are this close to it, as a share of the length.
const AT_END: f64 = 1e-6;

/// Put a mesh into the experiment in place of the specimen's dimensions; returns what was assumed about it. `field` is in the data's own
/// axes.
///
/// # Errors
/// Those of [`mesh_files::read`].
pub fn propose(path: &Path, field: Option<&Field>, experiment: &mut Value) -> Result<String> {
    let mut mesh = mesh_files::raise(mesh_files::read(path)?);
    let mut said = format!(
        "\nread from {}: {} elements; edges {}{}\nproposed, to be checked:\n",
        path.display(),
        mesh.elements.len(),
        listed(mesh.edges.keys()),
        regions(&mesh),
    );
    for remark in &mesh.remarks {
        let _ = writeln!(said, "  {remark}");
    }
    let mut object = json!({ "file": path });
    let unit = unit(&mesh, field);
    if unit != 1.0 {
        object["mm_per_unit"] = json!(unit);
        let _ = writeln!(
            said,
            "  mesh.mm_per_unit {unit}: the mesh is in metres, if it is that of these points"
        );
        for x in mesh.nodes.iter_mut().flatten() {
            *x *= unit;
        }
    }
    if let Some(specimen) = experiment["specimen"].as_object_mut() {
        for key in ["length_mm", "width_mm", "hole", "clamp", "note"] {
            specimen.remove(key);
        }
    }
    let axis = axis(&mesh, field, experiment);
    experiment["measurement"]["loading_axis"] = json!(["x", "y"][axis]);
    said += &place(&mesh, field, experiment, &mut object);
    said += &loads(&mesh, axis, &mut object).map_err(|e| e.within(path.display()))?;
    experiment["mesh"] = object;
    Ok(said)
}

/// The axis of the load: that of the data's larger stretch, or the mesh's longer side where there are no data.
fn axis(mesh: &ImportedMesh, field: Option<&Field>, experiment: &Value) -> usize {
    let [low, high] = mesh.bounds();
    let is_y = match field {
        Some(_) => experiment["measurement"]["loading_axis"] == "y",
        None => high[1] - low[1] > high[0] - low[0],
    };
    usize::from(is_y)
}

/// Length of the mesh's unit, mm.
fn unit(mesh: &ImportedMesh, field: Option<&Field>) -> f64 {
    let size = |[low, high]: [[f64; 2]; 2]| (high[0] - low[0]).max(high[1] - low[1]);
    let is_metres = field.is_some_and(|field| size(field.bounds()) > METRES * size(mesh.bounds()));
    if is_metres { 1000.0 } else { 1.0 }
}

/// Where the mesh lies in the data.
fn place(
    mesh: &ImportedMesh,
    field: Option<&Field>,
    experiment: &mut Value,
    object: &mut Value,
) -> String {
    let circle = mesh.circle(HOLE);
    let Some(field) = field else {
        let center = circle.map_or([0.0; 2], |c| c.center);
        experiment["measurement"]["hole_center_in_data_mm"] = json!(center);
        return "  the data's frame is taken to be the mesh's own\n".into();
    };
    let (bounds, points) = (mesh.bounds(), field.bounds());
    let fits = [0, 1].iter().all(|&k| {
        let room = BEYOND * (bounds[1][k] - bounds[0][k]);
        points[0][k] >= bounds[0][k] - room && points[1][k] <= bounds[1][k] + room
    });
    let middle = |[low, high]: [[f64; 2]; 2]| [0, 1].map(|k| 0.5 * (low[k] + high[k]));
    let (origin, in_data, why) = match (circle, hole(&field.points)) {
        (Some(Circle { center, radius }), Some((gap, _)))
            if fits && (gap[0] - center[0]).hypot(gap[1] - center[1]) < SAME_PLACE * radius =>
        (
            None,
            center,
            "data and mesh are taken to have one frame, because the gap in the points lies at the mesh's circle \"hole\"".into(),
        ),
        (Some(Circle { center, .. }), Some((gap, _))) => (
            None,
            gap.map(rounded),
            format!("the gap in the points is the mesh's circle \"hole\", whose centre is {center:.2?} in the mesh"),
        ),
        (Some(Circle { center, .. }), None) if fits => (
            None,
            center,
            "no gap in the points looks like a hole; data and mesh are taken to have one frame, because the points lie within the mesh".into(),
        ),
        (None, _) if fits => (
            Some([0.0; 2]),
            [0.0; 2],
            "data and mesh are taken to have one frame, because the points lie within the mesh".into(),
        ),
        _ => (
            Some(middle(bounds).map(rounded)),
            middle(points).map(rounded),
            "the middle of the points is taken for the middle of the mesh, which is a guess".into(),
        ),
    };
    experiment["measurement"]["hole_center_in_data_mm"] = json!(in_data);
    if let Some(origin) = origin {
        object["origin_mm"] = json!(origin);
    }
    let origin = origin.map_or(String::new(), |o| format!("mesh.origin_mm {o:?} at "));
    format!("  {origin}hole_center_in_data_mm {in_data:?}: {why}\n")
}

/// To as many decimals of a millimetre as points tell of a place.
fn rounded(value: f64) -> f64 {
    round(value, 2)
}

/// What loads it: the ends along the load.
///
/// # Errors
/// The input's fault: no edge on the boundary.
fn loads(mesh: &ImportedMesh, axis: usize, object: &mut Value) -> Result<String> {
    let direction = |sign: f64| {
        let mut direction = [0.0; 2];
        direction[axis] = sign;
        direction
    };
    let [low, high] = [(LOW, 0), (HIGH, 1)].map(|(name, end)| end_of(mesh, axis, name, end));
    let names: Vec<&String> = mesh.edges.keys().collect();
    if let (Some(low), Some(high)) = (low, high) {
        object["load"] = json!([
            { "edge": high, "direction": direction(1.0) },
            { "edge": low, "direction": direction(-1.0) },
        ]);
        return Ok(format!(
            "  mesh.load: uniform tractions pull \"{low}\" and \"{high}\", the ends along {}, apart\n",
            ["x", "y"][axis]
        ));
    }
    let Some(&first) = names.first() else {
        let there = match mesh.remarks.as_slice() {
            [] => regions(mesh),
            remarks => remarks.join("; "),
        };
        return Err(Error::input("mesh.load", "a named edge on the boundary")
            .found(there)
            .hint("name the loaded boundary lines by a physical group (Gmsh) or *SURFACE or *NSET (Abaqus); or delete the groups of lines, and the sides of the box get names"));
    };
    object["load"] = json!({ "edge": first, "direction": direction(1.0) });
    Ok(format!(
        "  mesh.load: NOT known; \"{first}\" stands there only because an edge must. Say which of {} are loaded, along which direction, and which are held (mesh.supports)\n",
        listed(names)
    ))
}

/// The name of the edge at an end of the mesh: that of the convention, or one of which all points lie there.
fn end_of<'a>(mesh: &'a ImportedMesh, axis: usize, name: &'a str, end: usize) -> Option<&'a str> {
    if mesh.edges.contains_key(name) {
        return Some(name);
    }
    let [low, high] = mesh.bounds();
    let limit = [low, high][end][axis];
    let room = AT_END * (high[axis] - low[axis]);
    let is_there = |n: u32| (mesh.nodes[n as usize][axis] - limit).abs() <= room;
    let lies_there = |edges: &[BoundaryEdge]| {
        edges.iter().all(|&e| {
            let (a, _, b) = mesh.edge_nodes(e);
            is_there(a) && is_there(b)
        })
    };
    let found = mesh.edges.iter().filter(|(_, edges)| lies_there(edges));
    // Gmsh's input files for Abaqus number every line beside the names that the user gave
    let named = found.min_by_key(|(name, _)| is_numbered(name));
    named.map(|(name, _)| name.as_str())
}

/// Whether a name is one that Gmsh gives a line by its number.
fn is_numbered(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    let number = lower.strip_prefix("line").unwrap_or(&lower);
    !number.is_empty() && number.chars().all(|c| c.is_ascii_digit())
}

fn listed<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    let names: Vec<String> = names
        .into_iter()
        .map(|name| format!("\"{name}\""))
        .collect();
    if names.is_empty() {
        "without names (a physical group of Gmsh, a *SURFACE or *NSET of Abaqus names them)".into()
    } else {
        names.join(", ")
    }
}

/// The named regions, if there are any.
fn regions(mesh: &ImportedMesh) -> String {
    let names: Vec<&str> = mesh.regions.keys().map(String::as_str).collect();
    if names.is_empty() {
        return String::new();
    }
    format!(
        "; regions {} (mesh.regions may give them a layup_deg, rotation_deg or thickness_mm of their own)",
        names.join(", ")
    )
}

/// Draw the model's mesh with the points of the data; returns what is to be said of it.
///
/// # Errors
/// A file that cannot be written.
pub fn draw(model: &Model, field: Option<&Field>, path: &Path) -> Result<String> {
    let experiment = model.experiment();
    let (mesh, frame) = (
        experiment.geometry().mesh(&[]),
        experiment.measurement.frame,
    );
    let points = field.map_or(&[][..], |field| &field.points);
    if let Some(figure) = mesh_figure(&mesh_lines(&mesh, &frame, points))? {
        files::replace(path, figure.file())?;
    }
    let mut said = format!("  {} shows the mesh, its named edges", path.display());
    if points.is_empty() {
        said += " and what acts on them\n";
        return Ok(said);
    }
    let off = on_mesh(&mesh, &frame, points)
        .iter()
        .filter(|on| !**on)
        .count();
    let _ = match off {
        0 => writeln!(said, " and the points, which all lie on it"),
        off => writeln!(
            said,
            " and the points; {off} of {} lie OFF the mesh (red) and cannot be used: look at the frame before anything is run",
            points.len()
        ),
    };
    Ok(said)
}
