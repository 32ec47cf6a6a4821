//! What went in: the model file as it was given, with what is still the template's.

use serde_json::Value;

use crate::infer::unchanged;
use crate::section::{Section, Table, TableCell, row};

/// Keys that say how to compute, and not what was measured.
const OF_THE_PROGRAM: [&str; 5] = ["schema", "name", "note", "reduced_model", "likelihood"];

/// "What you told the program": every value of a model file under its key.
pub fn told(model: &Value) -> Section {
    let mut rows = Vec::new();
    for (key, value) in model.as_object().into_iter().flatten() {
        if !OF_THE_PROGRAM.contains(&key.as_str()) {
            flatten(key, value, &mut rows);
        }
    }
    let left = unchanged(model);
    let of_template = |key: &str| {
        let is_prior = |name: &str| key.starts_with(&format!("material.parameters.{name}.prior"));
        left.iter().any(|l| match l.strip_prefix("prior of ") {
            Some(name) => is_prior(name),
            None => key.strip_prefix("experiments.0.") == Some(l.as_str()),
        })
    };
    let rows = rows.into_iter().map(|(key, value)| {
        let mark = match of_template(&key) {
            true => "as in the template of init: check".into(),
            false => TableCell::Blank,
        };
        row(key, [value.into(), mark])
    });
    Section::new("What you told the program")
        .say(not_changed(model).unwrap_or_default())
        .with(Table::new("", ["key", "value", ""], rows))
}

/// What went in, in a few lines, of the first experiment and of the files of all.
pub fn in_short(model: &Value) -> Table {
    let first = &model["experiments"][0];
    let left = unchanged(model);
    let specimen = &first["specimen"];
    let mm = |value: &Value| value.as_f64().map(|v| format!("{v} mm"));
    let size = mm(&specimen["length_mm"]).zip(mm(&specimen["width_mm"]));
    let hole = mm(&specimen["hole"]["diameter_mm"]);
    let thickness = mm(&specimen["thickness_mm"]["mean"]);
    let thickness = thickness.map(|t| format!("{t} +- {}", specimen["thickness_mm"]["sd"]));
    let forces = first["steps"].as_array().map(|steps| {
        let forces: Vec<String> = steps
            .iter()
            .map(|s| s["force_N"].to_string().replace("null", "?"))
            .collect();
        format!("{} N", forces.join(", "))
    });
    let forces = forces.or_else(|| first["load"]["force_N"].as_f64().map(|f| format!("{f} N")));
    let images = &first["measurement"]["image_correlation"];
    let subset = mm(&images["subset_mm"]).map(|s| {
        let distance = mm(&images["camera_distance_mm"]).unwrap_or("unknown distance".into());
        format!("{s}, camera at {distance}")
    });
    let path = ["file", "dir"]
        .iter()
        .find_map(|key| first["measurement"][key].as_str());
    let path = path.map(|p| match p.rsplit(['/', '\\']).next() {
        None | Some("" | ".") => "beside the model file".to_string(),
        Some(name) => name.to_string(),
    });
    let list = |value: &Value| {
        let all = value.as_array()?.iter().filter_map(Value::as_f64);
        let all = all.map(|v| v.to_string());
        Some(all.collect::<Vec<_>>().join(", "))
    };
    let all = [
        (
            "plate",
            size.map(|(l, w)| format!("{l} x {w}")),
            "specimen.length_mm",
        ),
        ("hole", hole, "specimen.hole.diameter_mm"),
        (
            "layup, degrees",
            list(&specimen["layup_deg"]),
            "specimen.layup_deg",
        ),
        ("thickness", thickness, "specimen.thickness_mm.mean"),
        ("force", forces, "load.force_N"),
        ("subset", subset, ""),
        ("measurement", path, ""),
    ];
    let rows = all.into_iter().filter_map(|(what, value, key)| {
        let mark = match left.iter().any(|l| l == key) {
            true => "as in the template: check".into(),
            false => TableCell::Blank,
        };
        Some(row(what, [value?.into(), mark]))
    });
    Table::new("", ["", "", " "], rows)
}

/// What is said of values that nobody changed.
pub fn not_changed(model: &Value) -> Option<String> {
    let left = unchanged(model);
    (!left.is_empty()).then(|| {
        format!(
            "As in the template of `plychain init`: {}. Check that they are those of your test.",
            left.join(", ")
        )
    })
}

/// Leaves of a value, lists of plain values in one.
fn flatten(key: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(all) => {
            for (k, v) in all.iter().filter(|(k, _)| *k != "note") {
                flatten(&format!("{key}.{k}"), v, rows);
            }
        }
        Value::Array(all) if all.iter().any(Value::is_object) => {
            for (k, v) in all.iter().enumerate() {
                flatten(&format!("{key}.{k}"), v, rows);
            }
        }
        Value::Array(all) if all.is_empty() => {}
        Value::String(text) => rows.push((key.into(), text.clone())),
        plain => rows.push((key.into(), plain.to_string().replace(',', ", "))),
    }
}
