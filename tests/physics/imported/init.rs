//! What `init --mesh` proposes: frame, unit, loads, and a picture in which a wrong frame is seen.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use plychain::mesh_files::ElementKind;
use serde_json::{Value, json};

use super::model::{Model, grid, rectangle, ring};
use super::writers::{inp, msh41};
use crate::common::plychain_in;

const HEADER: &str = "coor.X [mm];coor.Y [mm];disp.Horizontal Displacement U [mm];disp.Vertical Displacement V [mm]\n";

/// An export of points on a lattice of 0.5 mm that is stretched along x.
fn export(folder: &Path, [low, high]: [[f64; 2]; 2], keep: &dyn Fn(f64, f64) -> bool) {
    let mut text = String::from(HEADER);
    let counts = [0, 1].map(|k| ((high[k] - low[k]) / 0.5) as usize);
    for k in 0..=counts[0] * counts[1] {
        let (x, y) = (
            low[0] + 0.5 * (k % counts[0]) as f64,
            low[1] + 0.5 * (k / counts[0]) as f64,
        );
        if keep(x, y) {
            writeln!(text, "{x};{y};{};{}", 7e-4 * x, -2e-4 * y).unwrap();
        }
    }
    fs::write(folder.join("field.csv"), text).unwrap();
}

/// The experiment that `init` writes, what it says, and its picture.
fn proposed(folder: &Path, mesh: &str, with_data: bool) -> (Value, String, String) {
    let mut arguments = vec!["init", "plate", "--mesh", mesh];
    if with_data {
        arguments.extend(["--csv", "field.csv"]);
    }
    let output = plychain_in(folder, &arguments);
    let said = [output.stdout, output.stderr].map(|t| String::from_utf8_lossy(&t).into_owned());
    assert!(output.status.success(), "{said:?}");
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    let mut model: Value = serde_json::from_str(&read("plate.json")).unwrap();
    let picture = read("plate-mesh.svg");
    fs::remove_file(folder.join("plate.json")).unwrap();
    (model["experiments"][0].take(), said.concat(), picture)
}

/// What stands beside the red mark.
const OFF: &str = "measured, off the mesh";

/// Whether a picture has a text of its own with these words.
fn shows(picture: &str, words: &str) -> bool {
    picture.lines().any(|line| line.trim() == words)
}

fn written(mesh: &Model) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("plate.msh"), msh41(mesh, false)).unwrap();
    fs::write(folder.path().join("plate.inp"), inp(mesh)).unwrap();
    folder
}

#[test]
fn data_in_the_frame_of_the_mesh_lie_on_it_and_others_are_red() {
    let folder = written(&rectangle(ElementKind::Q8, [6, 3]));
    let folder = folder.path();
    export(folder, [[-8.0, 6.0], [18.0, 14.0]], &|_, _| true);
    for mesh in ["plate.msh", "plate.inp"] {
        let (experiment, said, picture) = proposed(folder, mesh, true);
        assert!(said.contains("which all lie on it"), "{said}");
        assert!(said.contains("regions all, half "), "{said}");
        assert_eq!(experiment["mesh"]["origin_mm"], json!([0.0, 0.0]));
        // the ends along the data's stretch, by the places of the edges
        let loads = &experiment["mesh"]["load"];
        assert_eq!(loads[0], json!({ "edge": "u1", "direction": [1.0, 0.0] }));
        assert_eq!(loads[1], json!({ "edge": "u0", "direction": [-1.0, 0.0] }));
        assert!(experiment["specimen"].get("length_mm").is_none());
        for words in ["u0: force", "v1", "measured point"] {
            assert!(shows(&picture, words), "{words} is not in the picture");
        }
        assert!(!shows(&picture, OFF), "{picture}");
    }
    // a window that does not fit: the middles are laid on each other, and what is beyond is said
    export(folder, [[0.0, 0.0], [60.0, 6.0]], &|_, _| true);
    let (experiment, said, picture) = proposed(folder, "plate.msh", true);
    assert_eq!(experiment["mesh"]["origin_mm"], json!([5.0, 10.0]));
    assert!(said.contains("OFF the mesh"), "{said}");
    assert!(shows(&picture, OFF));
}

#[test]
fn a_hole_in_the_points_is_that_of_the_mesh_though_it_is_in_metres() {
    let metres = |scale: f64| {
        let mut mesh = ring(ElementKind::T6, [3, 24]);
        mesh.nodes.iter_mut().flatten().for_each(|x| *x *= scale);
        let hole = mesh.edges.remove("u0").unwrap();
        mesh.edges.insert("hole".into(), hole);
        written(&mesh)
    };
    let folder = metres(1e-3);
    let round = |x: f64, y: f64| (3.1..7.9).contains(&(x - 20.0).hypot(y - 10.0));
    export(folder.path(), [[12.0, 2.0], [28.5, 18.5]], &round);
    let (experiment, said, _) = proposed(folder.path(), "plate.msh", true);
    assert_eq!(experiment["mesh"]["mm_per_unit"], 1000.0, "{said}");
    assert!(said.contains("which all lie on it"), "{said}");
    for (k, known) in [20.0, 10.0].iter().enumerate() {
        let center = &experiment["measurement"]["hole_center_in_data_mm"][k];
        assert!((center.as_f64().unwrap() - known).abs() < 0.1, "{center}");
    }
    // in one frame the centre is the mesh's own to all digits, not that of the gap
    export(folder.path(), [[-8.0, -8.0], [8.5, 8.5]], &|x, y| {
        (3.1..7.9).contains(&(x + 0.013).hypot(y))
    });
    let (experiment, one_frame, _) = proposed(folder.path(), "plate.msh", true);
    for k in 0..2 {
        let center = &experiment["measurement"]["hole_center_in_data_mm"][k];
        assert!(
            center.as_f64().unwrap().abs() < 1e-6,
            "{center}: {one_frame}"
        );
    }
    // a rim that is loaded all around has no ends
    assert!(said.contains("mesh.load: NOT known"), "{said}");
}

#[test]
fn without_data_the_longer_side_is_pulled() {
    let mesh = grid(ElementKind::Q4, [2, 8], false, &|u, v| [5.0 * u, 20.0 * v]);
    let folder = written(&mesh);
    let (experiment, _, picture) = proposed(folder.path(), "plate.inp", false);
    assert_eq!(experiment["measurement"]["loading_axis"], "y");
    let loads = &experiment["mesh"]["load"];
    assert_eq!(loads[0], json!({ "edge": "v1", "direction": [0.0, 1.0] }));
    assert!(shows(&picture, "v0: force") && !shows(&picture, "measured point"));
}
