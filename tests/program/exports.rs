//! Tables of displacements as programs write them: read as they are, in the right unit, or stopped by one precise question.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::common::plychain_in;

mod conventions;
mod forms;
mod mangled;
mod real;

/// A row: place and displacement, mm.
pub type FieldRow = [f64; 4];

/// A strip with a hole of 6 mm about (3.25, -1.5): points 1 mm apart, stretched along y and more beside the hole, contracted along x, moved
/// by a lot.
pub fn strip() -> Vec<FieldRow> {
    let mut rows = Vec::new();
    for k in 0..31 * 41 {
        let (x, y) = (f64::from(k % 31) - 12.0, f64::from(k / 31) - 22.0);
        let [dx, dy] = [x - 3.0, y + 2.0];
        if dx.hypot(dy) > 3.0 {
            let near = 9.0 / (dx * dx + dy * dy);
            let [u, v] = [-3e-4 * (x + dx * near), 1e-3 * (y + 2.0 * dy * near)];
            rows.push([x + 0.25, y + 0.5, 0.3125 + u, -0.1875 + v]);
        }
    }
    rows
}

/// The rows as lines, cells between `delimiter`s, each made by `cell` of the row's number and value.
pub fn lines(rows: &[FieldRow], delimiter: &str, cell: impl Fn(usize, f64) -> String) -> String {
    let line = |row: &FieldRow| {
        let cells: Vec<String> = row.iter().enumerate().map(|(k, v)| cell(k, *v)).collect();
        cells.join(delimiter) + "\n"
    };
    rows.iter().map(line).collect()
}

/// Cells with six decimals.
pub fn decimals(_: usize, value: f64) -> String {
    format!("{value:.6}")
}

/// What the program does with arguments in a folder: whether it was content, and all that it said.
pub fn said(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let Output {
        status,
        stdout,
        stderr,
    } = plychain_in(folder, arguments);
    let text = [stdout, stderr]
        .map(|t| String::from_utf8_lossy(&t).into_owned())
        .concat();
    assert!(
        status.code().is_some_and(|c| c < 2),
        "{arguments:?}: {text}"
    );
    (status.success(), text)
}

/// The model that `init` makes of one table, and what it said.
pub fn proposed(table: &[u8], name: &str, more: &[&str]) -> Result<(Value, String), String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), table).unwrap();
    let (done, text) = said(
        folder.path(),
        &[&["init", "a", "--csv", name], more].concat(),
    );
    if !done {
        return Err(text);
    }
    let model = fs::read_to_string(folder.path().join("a.json")).unwrap();
    Ok((serde_json::from_str(&model).unwrap(), text))
}

/// The measurement of a model.
pub fn measurement(model: &Value) -> &Value {
    &model["experiments"][0]["measurement"]
}
