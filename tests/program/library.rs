//! The crate as a library: closures as densities, arrays as measurements, and what it needs without its features.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use plychain::{Ensemble, Model, Options, Silent, density, identify, laplace};

use crate::common::root;

/// Most crates that a user of the samplers compiles.
const CRATES: usize = 60;

#[test]
fn samplers_alone_need_few_crates() {
    let arguments = "tree --offline --no-default-features -e normal --prefix none --no-dedupe";
    let tree = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
        .current_dir(root())
        .args(arguments.split(' '))
        .output()
        .unwrap();
    assert!(tree.status.success(), "{tree:?}");
    let text = String::from_utf8(tree.stdout).unwrap();
    let name_and_version = |line: &str| line.split(' ').take(2).collect::<Vec<_>>().join(" ");
    let crates: BTreeSet<String> = text.lines().map(name_and_version).collect();
    assert!(
        crates.len() > 10 && crates.len() <= CRATES,
        "{} crates",
        crates.len()
    );
    for heavy in ["clap", "faer", "nalgebra", "plotters"] {
        assert!(
            !crates.iter().any(|c| c.starts_with(&format!("{heavy} "))),
            "{heavy}"
        );
    }
}

/// The mode and the covariance of a normal density in closed form, from a start far off.
#[test]
fn laplace_of_a_normal_is_exact() {
    let target = density(["a", "b", "c"], |x| {
        let [a, b, c] = [x[0] - 3.0, 1e3 * (x[1] + 1.0), x[2] - x[0]];
        -0.5 * (a * a + b * b + 4.0 * c * c)
    });
    let found = laplace(&target, &[0.0, 0.0, 0.0], &[1.0, 0.1, 1.0]).unwrap();
    for (x, exact) in found.mode.iter().zip([3.0, -1.0, 3.0]) {
        assert!((x - exact).abs() < 1e-5, "{:?}", found.mode);
    }
    let exact = [1.0, 0.0, 1.0, 0.0, 1e-6, 0.0, 1.0, 0.0, 1.25];
    for (k, (c, exact)) in found.covariance.iter().zip(exact).enumerate() {
        let size = [1.0, 1e-3, 1.25_f64.sqrt()];
        let scale = size[k / 3] * size[k % 3];
        assert!((c - exact).abs() < 1e-4 * scale, "{:?}", found.covariance);
    }
    // no curvature along c
    let flat = density(["a", "c"], |x| -0.5 * x[0] * x[0]);
    assert!(laplace(&flat, &[1.0, 1.0], &[1.0, 1.0]).is_err());
}

const STRIP: &str = r#"{
  "schema": "plychain-model/2", "name": "strip",
  "material": { "kind": "isotropic", "parameters": {
    "E_GPa": { "prior": { "normal": { "mean": 72, "sd": 7 } } }, "nu": { "prior": { "normal": { "mean": 0.3, "sd": 0.05 } } } } },
  "experiments": [ { "name": "tension", "kind": "field",
    "specimen": { "length_mm": 80, "width_mm": 20, "thickness_mm": { "mean": 2, "sd": 0.01 } },
    "load": { "force_N": 4000 }, "gauge": "window", MEASUREMENT, "effects": ["rigid_translation"] } ],
  "reduced_model": { "snapshots": 40, "modes": 2, "degree": 3 }, "likelihood": { "model_error_fraction": 0.0 } }"#;

fn strip(measurement: &str, path: &Path) -> Model {
    let text = STRIP.replace("MEASUREMENT", &format!("\"measurement\": {measurement}"));
    Model::parse(&text, path).unwrap()
}

/// Loading along y of the data, whose origin is not the specimen's middle.
fn measured() -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
    let strain = 4000.0 / (68e3 * 20.0 * 2.0);
    let noise = |k: usize| 3e-5 * ((k as f64 * 12.9898).sin() * 43758.5453).fract();
    let points: Vec<[f64; 2]> = (0..961)
        .map(|k| [0.5 * (k % 31) as f64 + 2.0, 0.5 * (k / 31) as f64])
        .collect();
    let moved = points.iter().enumerate().map(|(k, [x, y])| {
        [
            -0.33 * strain * x + noise(2 * k),
            strain * y + 0.01 + noise(2 * k + 1),
        ]
    });
    let moved = moved.collect();
    (points, moved)
}

/// Arrays and a table of the same numbers are the same measurement, to the bit.
#[test]
fn arrays_are_measured_like_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let (points, moved) = measured();
    let rows = points
        .iter()
        .zip(&moved)
        .map(|([x, y], [u, v])| format!("{x:?},{y:?},{u:?},{v:?}\n"));
    std::fs::write(
        folder.path().join("field.csv"),
        "x,y,u,v\n".to_string() + &rows.collect::<String>(),
    )
    .unwrap();
    let form = r#""format": "csv", "columns": { "x": "x", "y": "y", "ux": "u", "uy": "v" },
        "units": { "coordinates": "mm", "displacements": "mm" }, "loading_axis": "y", "hole_center_in_data_mm": [9.5, 7.5]"#;
    let path = folder.path().join("model.json");
    let of_file = strip(&format!("{{ {form}, \"file\": \"field.csv\" }}"), &path);
    let none = format!("{{ {form}, \"file\": \"in memory\" }}");
    let of_arrays = strip(&none, &path).measured(&points, &moved).unwrap();
    let sampler = Ensemble::default();
    let draws = [of_file, of_arrays].map(|model| {
        let options = Options::new(&sampler);
        let found = identify(&model, &options, &Silent).unwrap();
        for (name, truth) in [("E_GPa", 68.0), ("nu", 0.33)] {
            let (mean, sd) = found.moments(name).unwrap();
            assert!((mean - truth).abs() < 4.0 * sd, "{name} {mean} +- {sd}");
        }
        found.draws
    });
    assert_eq!(draws[0].values(), draws[1].values());

    let model = || strip(&none, &path);
    let error = model().measured(&points, &moved[1..]).err().unwrap();
    assert!(error.to_string().contains("961"), "{error}");
    let mut odd = moved.clone();
    odd[7][1] = f64::NAN;
    let error = model().measured(&points, &odd).err().unwrap();
    assert!(error.to_string().contains("point 7"), "{error}");
    assert!(model().measured(&points[..9], &moved[..9]).is_err());
    assert!(model().read_field().is_err(), "nothing was measured");
}
