//! Load series as they come in: the model's steps, fields matched point by point, what is refused and what is said, and what `init`
//! proposes.

use std::fs;
use std::path::{Path, PathBuf};

use plychain::error::{Blame, Error};
use plychain::field::{PartialSubsets, Series, table};
use plychain::infer::Model;
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::program::{root, shared};

/// A closed form of the displacement (ux, uy) about a hole of radius 3 under a load along y: uniform strain and a perturbation that
/// decays with the distance, per newton.
fn per_newton([x, y]: [f64; 2]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let near = 3e-6 * 9.0 / r2;
    [-3e-7 * x - near * x, 1e-6 * y + 2.0 * near * y]
}

/// Points of a grid with a hole, and the numbers 0, 1, 2 ... for what is random.
fn grid() -> Vec<[f64; 2]> {
    let points = (0..31 * 41).map(|k| {
        [
            0.5 * f64::from(k % 31) - 7.5,
            0.5 * f64::from(k / 31) - 10.0,
        ]
    });
    points.filter(|[x, y]| x.hypot(*y) > 3.4).collect()
}

/// A number in [-1, 1] that depends on two others.
fn wobble(a: usize, b: usize) -> f64 {
    let x = (a as f64 * 12.9898 + b as f64 * 78.233).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

/// Step `n` under `force`: load, rigid motion of tenths of a mm, noise of 0.1 um.
fn field(points: &[[f64; 2]], force: f64, n: usize) -> Vec<[f64; 2]> {
    let [tx, ty, turn] = [0, 1, 2].map(|k| wobble(n + 1, 1000 + k));
    let at = |(i, &[x, y]): (usize, &[f64; 2])| {
        let u = per_newton([x, y]);
        let noise = [0, 1].map(|k| 1e-4 * wobble(2 * i + k, 7 * n + 3));
        [
            force * u[0] + 0.3 * tx - 1e-3 * turn * y + noise[0],
            force * u[1] + 0.3 * ty + 1e-3 * turn * x + noise[1],
        ]
    };
    points.iter().enumerate().map(at).collect()
}

fn csv(points: &[[f64; 2]], u: &[[f64; 2]]) -> String {
    let rows = points.iter().zip(u);
    let rows = rows.map(|(p, u)| format!("{:.5},{:.5},{:.7},{:.7}\n", p[0], p[1], u[0], u[1]));
    std::iter::once("x_mm,y_mm,u_mm,v_mm\n".to_string())
        .chain(rows)
        .collect()
}

/// A folder with a model of these steps; the files are still to be written.
struct Case {
    folder: tempfile::TempDir,
    model: Value,
}

const FORCES: [f64; 5] = [500.0, 1000.0, 1500.0, 2000.0, 0.0];

fn name(k: usize) -> String {
    format!("step-{:02}.csv", k + 1)
}

impl Case {
    /// The model with steps of these forces.
    fn new(forces: &[Option<f64>]) -> Self {
        let text = fs::read_to_string(root().join("models/steel-s235.json")).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        let experiment = &mut model["experiments"][0];
        experiment["measurement"] = json!({
            "format": "csv",
            "columns": { "x": "x_mm", "y": "y_mm", "ux": "u_mm", "uy": "v_mm" },
            "units": { "coordinates": "mm", "displacements": "mm" },
            "loading_axis": "y",
            "hole_center_in_data_mm": [0.0, 0.0],
        });
        experiment["gauge"] = json!("window");
        experiment["specimen"] = json!({
            "length_mm": 80.0, "width_mm": 20.0, "hole": { "diameter_mm": 6.0, "center_mm": [0.0, 0.0] },
            "thickness_mm": { "mean": 2.0, "sd": 0.01 },
        });
        let all = experiment.as_object_mut().unwrap();
        all.retain(|key, _| key != "load" && key != "window_mm" && key != "plausible");
        let steps = forces.iter().enumerate();
        all.insert(
            "steps".into(),
            steps
                .map(|(k, force)| json!({ "file": name(k), "force_N": force }))
                .collect(),
        );
        Self {
            folder: tempfile::tempdir().unwrap(),
            model,
        }
    }

    /// The usual series, written.
    fn written() -> Self {
        let case = Self::new(&FORCES.map(Some));
        for (k, force) in FORCES.into_iter().enumerate() {
            case.write(k, &csv(&grid(), &field(&grid(), force, k)));
        }
        case
    }

    fn write(&self, k: usize, text: &str) {
        fs::write(self.folder.path().join(name(k)), text).unwrap();
    }

    fn parse(&self) -> Result<Model, Error> {
        Model::parse(&self.model.to_string(), &self.folder.path().join("m.json"))
    }

    fn read(&self) -> Result<Series, Error> {
        self.parse()?.read_series().map(Option::unwrap)
    }

    fn steps(&mut self) -> &mut Value {
        &mut self.model["experiments"][0]["steps"]
    }

    fn set_forces(&mut self, forces: &[f64]) {
        for (k, force) in forces.iter().enumerate() {
            self.steps()[k]["force_N"] = json!(force);
        }
    }

    /// The series is refused by the input's fault, with these words.
    fn refused(&self, words: &[&str]) {
        let error = self.read().expect_err("an error");
        assert_eq!(error.blame(), Blame::Input);
        let text = format!("{error} {:?}", error.hint_text());
        for word in words {
            assert!(text.contains(word), "\"{word}\" is missing in {text}");
        }
    }
}

#[test]
fn a_series_is_read_at_its_common_points() {
    let case = Case::written();
    let model = case.parse().unwrap();
    let series = model.read_series().unwrap().unwrap();
    assert_eq!(series.warnings, Vec::<String>::new());
    assert_eq!(series.reference, 3);
    let names: Vec<&str> = series.steps.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        ["step-01", "step-02", "step-03", "step-04", "step-05"]
    );
    assert_eq!(
        series.field.len() + series.field.rejected.outliers,
        grid().len()
    );
    for (k, step) in series.steps.iter().enumerate() {
        assert_eq!((step.force_n, step.lost), (Some(FORCES[k]), 0));
        let truth = field(&grid(), FORCES[k], k);
        for (p, u) in series.field.points.iter().zip(&step.displacement) {
            // direction 1 is the data's y
            let there = grid()
                .iter()
                .position(|q| (q[0] - p[1]).hypot(q[1] - p[0]) < 1e-4);
            let [x, y] = truth[there.unwrap()];
            assert!((u[0] - y).abs() < 1e-6 && (u[1] - x).abs() < 1e-6);
        }
    }
    assert_eq!(series.field.displacement, series.steps[3].displacement);
    assert_eq!(series.field.files, model.measurement_files().unwrap());
    assert_eq!(model.experiment().nominal_load().force_n, 2000.0);
    assert!((model.scene().setup.load.axial - 2000.0).abs() < 1e-9);
    // any number of threads reads the same bits
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = one.install(|| case.read().unwrap());
    for (a, b) in alone.steps.iter().zip(&series.steps) {
        assert_eq!(a.displacement, b.displacement);
    }
}

/// Another order of rows, and points that one step lacks: matched by their places, dropped and counted.
#[test]
fn points_that_a_step_lacks_are_dropped_and_counted() {
    let case = Case::written();
    let points = grid();
    let u = field(&points, FORCES[1], 1);
    let few: Vec<usize> = (0..points.len()).rev().filter(|i| i % 9 != 4).collect();
    let missing = points.len() - few.len();
    let text = csv(
        &few.iter().map(|&i| points[i]).collect::<Vec<_>>(),
        &few.iter().map(|&i| u[i]).collect::<Vec<_>>(),
    );
    case.write(1, &text);
    let series = case.read().unwrap();
    let lost: Vec<usize> = series.steps.iter().map(|s| s.lost).collect();
    assert_eq!(lost, [missing, 0, missing, missing, missing]);
    assert_eq!(series.field.rejected.unmatched, missing);
    let rest = few.len() - series.field.rejected.outliers;
    assert_eq!(series.field.len(), rest);
    assert_eq!(series.warnings.len(), 4, "{:?}", series.warnings);
    // the same place has the same displacement as in the file
    let (p, moved) = (series.field.points[77], series.steps[1].displacement[77]);
    let there = points
        .iter()
        .position(|q| (q[0] - p[1]).hypot(q[1] - p[0]) < 1e-4);
    assert!((moved[0] - u[there.unwrap()][1]).abs() < 1e-6);
    // and most of them missing is another thing
    let text: String = csv(&points, &u)
        .lines()
        .take(500)
        .map(|l| format!("{l}\n"))
        .collect();
    case.write(1, &text);
    case.refused(&["step-02.csv", "step-04.csv", "499", "another grid?"]);
}

/// An outlier of one step is one of all, and each step counts its own.
#[test]
fn an_outlier_of_one_step_goes_from_all() {
    let case = Case::written();
    let before = case.read().unwrap();
    let points = grid();
    let mut u = field(&points, FORCES[2], 2);
    let spoiled = points.iter().position(|p| *p == [5.0, 5.0]).unwrap();
    u[spoiled][0] += 0.05;
    case.write(2, &csv(&points, &u));
    let after = case.read().unwrap();
    assert_eq!(after.steps[2].outliers, before.steps[2].outliers + 1);
    assert_eq!(after.steps[1].outliers, before.steps[1].outliers);
    assert_eq!(after.field.len() + 1, before.field.len());
    assert!(
        after
            .field
            .points
            .iter()
            .all(|p| (p[0] - 5.0).hypot(p[1] - 5.0) > 0.1)
    );
    let mut kept = case;
    kept.model["experiments"][0]["measurement"]["outliers"] = json!("keep");
    assert_eq!(kept.read().unwrap().field.len(), points.len());
}

#[test]
fn the_steps_of_a_model_file_are_checked() {
    let forces = [Some(1000.5), None, Some(0.0)];
    let case = Case::new(&forces);
    let model = case.parse().unwrap();
    let steps = model.experiment().steps.as_ref().unwrap();
    assert_eq!(steps.iter().map(|s| s.force_n).collect::<Vec<_>>(), forces);
    assert_eq!(model.measurement_files().unwrap().len(), 3);
    let written = serde_json::to_string(&model.file).unwrap();
    let again = Model::parse(&written, Path::new("again.json")).unwrap();
    assert_eq!(again.experiment().steps, model.experiment().steps);
    assert_eq!(serde_json::to_string(&again.file).unwrap(), written);
    assert_eq!(
        Case::new(&[None, None])
            .parse()
            .unwrap()
            .experiment()
            .nominal_load()
            .force_n,
        1000.0
    );
    type Change = fn(&mut Value);
    let refused: [(Change, &[&str]); 9] = [
        (
            |e| e["steps"] = json!([{ "file": "a.csv" }]),
            &["steps[0]", "force_N", "null"],
        ),
        (
            |e| e["steps"] = json!([{ "force_N": 3 }]),
            &["steps[0]", "file"],
        ),
        (
            |e| e["steps"] = json!([{ "file": "a.csv", "force_N": "much" }]),
            &["steps[0].force_N"],
        ),
        (
            |e| e["steps"] = json!([{ "file": "a.csv", "force_N": 1, "force": 1 }]),
            &["steps[0]", "force"],
        ),
        (
            |e| e["steps"] = json!([]),
            &["experiments[0].steps", "at least one"],
        ),
        (
            |e| {
                e["steps"] =
                    json!([{ "file": "a.csv", "force_N": 1 }, { "file": "a.csv", "force_N": 2 }])
            },
            &["steps[1].file", "a.csv", "steps[0]"],
        ),
        (
            |e| e["load"] = json!({ "force_N": 10 }),
            &["experiments[0].load", "each of the steps"],
        ),
        (
            |e| e["measurement"]["file"] = json!("a.csv"),
            &["experiments[0].measurement", "each of the steps"],
        ),
        (
            |e| drop(e.as_object_mut().unwrap().remove("steps")),
            &["experiments[0].load", "steps"],
        ),
    ];
    for (change, words) in refused {
        let mut case = Case::new(&forces);
        change(&mut case.model["experiments"][0]);
        let error = case.parse().err().unwrap().to_string();
        for word in words.iter().chain(&["m.json"]) {
            assert!(error.contains(word), "\"{word}\" is missing in {error}");
        }
    }
    let mut single = Case::new(&forces);
    single.model["experiments"][0]
        .as_object_mut()
        .unwrap()
        .remove("steps");
    single.model["experiments"][0]["load"] = json!({ "force_N": 10 });
    let error = single.parse().err().unwrap().to_string();
    assert!(error.contains("experiments[0].measurement.file"), "{error}");
}

#[test]
fn the_image_correlation_says_pixels_and_partial_subsets() {
    let mut case = Case::written();
    let correlation = json!({ "subset_mm": 1.0, "partial_subsets": "kept", "pixel_mm": 0.05 });
    case.model["experiments"][0]["measurement"]["image_correlation"] = correlation.clone();
    let model = case.parse().unwrap();
    let read = model.experiment().measurement.image_correlation.unwrap();
    assert_eq!(
        (read.partial_subsets, read.pixel_mm),
        (PartialSubsets::Kept, Some(0.05))
    );
    let written = serde_json::to_value(&model.file).unwrap();
    assert_eq!(
        written["experiments"][0]["measurement"]["image_correlation"],
        correlation
    );
    for (key, value) in [("pixel_mm", json!(0.0)), ("partial_subsets", json!("some"))] {
        case.model["experiments"][0]["measurement"]["image_correlation"] =
            json!({ "subset_mm": 1.0, key: value });
        let error = case.parse().err().unwrap().to_string();
        assert!(error.contains("image_correlation"), "{error}");
    }
    case.model["experiments"][0]["measurement"]["image_correlation"] = json!({ "subset_mm": 1.0 });
    let read = case
        .parse()
        .unwrap()
        .experiment()
        .measurement
        .image_correlation
        .unwrap();
    assert_eq!(read.partial_subsets, PartialSubsets::Dropped);
}

#[test]
fn a_step_of_another_grid_or_twice_is_refused() {
    let case = Case::written();
    let shifted: Vec<[f64; 2]> = grid().iter().map(|p| [p[0] + 0.1, p[1]]).collect();
    case.write(1, &csv(&shifted, &field(&shifted, 1000.0, 1)));
    case.refused(&["step-02.csv", "another specimen or another grid?"]);
    // the reference step is named where it is the odd one
    let case = Case::written();
    case.write(3, &csv(&shifted, &field(&shifted, 2000.0, 3)));
    case.refused(&["step-04.csv: found 0 of its"]);
    // the same displacements under another name, in other decimals
    let case = Case::written();
    let copy = csv(&grid(), &field(&grid(), 500.0, 0)).replace("0,", "00,");
    case.write(1, &copy);
    case.refused(&["steps[1].file", "step-01.csv", "step-02.csv", "leave one"]);
    // two paths to one file
    let mut case = Case::written();
    let name = format!(
        "../{}/step-01.csv",
        case.folder.path().file_name().unwrap().display()
    );
    case.steps()[4]["file"] = json!(name);
    case.refused(&["steps[4].file", "step-01.csv", "steps[0].file"]);
}

#[test]
fn a_broken_step_is_refused_by_its_file() {
    for (text, words) in [
        ("", "an empty file"),
        ("x_mm,y_mm,u_mm,v_mm\n", "none complete"),
        (
            "x_mm,y_mm,u_mm,v_mm\nNaN,NaN,NaN,NaN\n1,2,NaN,NaN\n",
            "none complete",
        ),
        ("x_mm,y_mm,u_mm,v_mm\n1,2,3,4\n", "at least 24"),
        ("x,y,u,v\n1,2,3,4\n", "columns.x"),
    ] {
        let case = Case::written();
        case.write(2, text);
        case.refused(&["step-03.csv", words]);
    }
    let case = Case::written();
    let holes: String = csv(&grid(), &field(&grid(), 1500.0, 2))
        .lines()
        .enumerate()
        .map(|(k, line)| match k > 300 && k % 5 != 0 {
            true => "NaN,NaN,NaN,NaN\n".to_string(),
            false => format!("{line}\n"),
        })
        .collect();
    case.write(2, &holes);
    case.refused(&["step-03.csv", "leave the step out"]);
    fs::remove_file(case.folder.path().join(name(2))).unwrap();
    case.refused(&["step-03.csv", "readable"]);
}

/// Forces that contradict the fields are refused; forces that are merely odd are said to be.
#[test]
fn shuffled_and_wrong_forces_are_told() {
    let swapped: [&[f64]; 5] = [
        &[1000.0, 500.0, 1500.0, 2000.0, 0.0],
        &[500.0, 2000.0, 1500.0, 1000.0, 0.0],
        &[2000.0, 1500.0, 1000.0, 500.0, 0.0],
        &[0.0, 500.0, 1000.0, 1500.0, 2000.0],
        // ten times too small
        &[500.0, 1000.0, 1500.0, 200.0, 0.0],
    ];
    for forces in swapped {
        let mut case = Case::written();
        case.set_forces(forces);
        case.refused(&[".force_N", "larger force with a smaller strain"]);
    }
    // ten times too large
    let mut case = Case::written();
    case.set_forces(&[500.0, 1000.0, 1500.0, 20_000.0, 0.0]);
    case.refused(&["steps[3].force_N", "step-04.csv", "20000"]);
    let implied = case.read().unwrap_err().to_string();
    assert!(implied.contains("about 2000"), "{implied}");
    // the forces of fewer steps known: the same contradiction
    let mut case = Case::written();
    case.set_forces(&[1000.0, 500.0, 1500.0, 2000.0, 0.0]);
    for k in [2, 4] {
        case.steps()[k]["force_N"] = Value::Null;
    }
    case.refused(&["larger force"]);
    // ... and of one: nothing to contradict
    for k in [1, 3] {
        case.steps()[k]["force_N"] = Value::Null;
    }
    assert_eq!(case.read().unwrap().warnings, Vec::<String>::new());
}

/// What tests do is no error: compression, unloading on the way, yielding with what stays of it, a large constant and drifting
/// strain of the picture.
#[test]
fn what_happens_in_tests_raises_no_alarm() {
    let cases: [(&[f64], &dyn Fn(usize, f64) -> f64); 5] = [
        (&[-500.0, -1000.0, -1500.0], &|_, f| f),
        (&[500.0, 1500.0, 700.0, 2000.0, 0.0], &|_, f| f),
        // yielding: a tenth more at the highest force, which stays
        (&[500.0, 1000.0, 2000.0, 1000.0, 0.0], &|k, f| {
            f + if k >= 2 { 200.0 } else { 0.0 }
        }),
        // a load cell with an error of 2 %
        (&[500.0, 1000.0, 1500.0, 2000.0, 0.0], &|k, f| {
            f * (1.0 + 0.02 * wobble(k, 5))
        }),
        // a dwell at constant force
        (&[2000.0, 1990.0, 1980.0], &|_, f| f),
    ];
    for (forces, acts) in cases {
        let case = Case::new(&forces.iter().map(|f| Some(*f)).collect::<Vec<_>>());
        for (k, &force) in forces.iter().enumerate() {
            let mut u = field(&grid(), acts(k, force), k);
            // towards the camera: the same strain in both directions, as large as the load's
            let zoom = 1e-3 + 1e-3 * k as f64;
            for (u, p) in u.iter_mut().zip(grid()) {
                (0..2).for_each(|c| u[c] += zoom * p[c]);
            }
            case.write(k, &csv(&grid(), &u));
        }
        let warnings = case.read().unwrap().warnings;
        assert!(warnings.is_empty(), "{forces:?}: {warnings:?}");
    }
    // much yielding is said, and no error
    let case = Case::new(&FORCES.map(Some));
    for (k, force) in FORCES.into_iter().enumerate() {
        let acts = force + [0.0, 0.0, 0.0, 2500.0, 2500.0][k];
        case.write(k, &csv(&grid(), &field(&grid(), acts, k)));
    }
    let warnings = case.read().unwrap().warnings;
    assert!(
        warnings.iter().any(|w| w.contains("yielding")),
        "{warnings:?}"
    );
}

/// A step on the same grid whose field is not that of the others.
#[test]
fn a_step_of_another_specimen_is_refused() {
    let case = Case::written();
    let points = grid();
    let mut u = field(&points, 1500.0, 2);
    for (u, [x, y]) in u.iter_mut().zip(&points) {
        // the perturbation of a hole elsewhere in place of its own
        let (own, other) = (per_newton([*x, *y]), per_newton([x - 6.0, y - 13.0]));
        u[0] += 1500.0 * (other[0] - own[0]);
        u[1] += 1500.0 * (other[1] - own[1]);
    }
    case.write(2, &csv(&points, &u));
    case.refused(&["step-03.csv", "cosine", "another specimen"]);
}

#[test]
fn sigma_and_correlation_drop_points_and_keep_deviations() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let mut text = String::from("x;y;u;v;sigma;zncc\n");
    for k in 0..100 {
        let (sigma, zncc) = match k {
            3 => ("-1", "0.99"),
            4 => ("0", "0.99"),
            5 => ("", "0.99"),
            6 => ("0.25", "0.89"),
            7 => ("0.25", "nan"),
            8 => ("nan", ""),
            _ => ("0.25", "0.9"),
        };
        text += &format!(
            "{};{};{};0.5;{sigma};{zncc}\n",
            k % 10,
            k / 10,
            0.01 * f64::from(k)
        );
    }
    fs::write(&path, &text).unwrap();
    let spec = |columns: Value, units: Value| -> plychain::field::MeasurementSpec {
        let mut all = json!({ "x": "x", "y": "y", "ux": "u", "uy": "v" });
        all.as_object_mut()
            .unwrap()
            .extend(columns.as_object().unwrap().clone());
        serde_json::from_value(json!({
            "format": "csv", "file": "t.csv", "columns": all, "units": units, "loading_axis": "x",
            "hole_center_in_data_mm": [0, 0], "outliers": "keep",
        }))
        .unwrap()
    };
    let mm = json!({ "coordinates": "mm", "displacements": "um" });
    let both = spec(
        json!({ "sigma": "sigma", "correlation": "zncc" }),
        mm.clone(),
    );
    let written = serde_json::to_string(&both).unwrap();
    assert_eq!(
        serde_json::from_str::<plychain::field::MeasurementSpec>(&written).unwrap(),
        both
    );
    let field = both.read(folder.path(), None).unwrap();
    assert_eq!((field.len(), field.rejected.uncorrelated), (94, 6));
    let sigma = field.sigma.as_ref().unwrap();
    assert!(sigma.len() == 94 && sigma.iter().all(|s| (s - 0.25e-3).abs() < 1e-12));
    // a window cuts them with their points
    let cut = both
        .read(folder.path(), Some([[0.5, -1.0], [20.0, 20.0]]))
        .unwrap();
    assert_eq!(cut.sigma.unwrap().len(), cut.points.len());
    assert!(
        spec(json!({}), mm.clone())
            .read(folder.path(), None)
            .unwrap()
            .sigma
            .is_none()
    );
    // pixels with a scale are lengths; sigma in pixels without one tells failed points alone
    let px = json!({ "coordinates": "px", "displacements": "px", "mm_per_pixel": 0.5 });
    let pixels = spec(json!({ "sigma": "sigma" }), px)
        .read(folder.path(), None)
        .unwrap();
    assert!(
        (pixels.bounds()[1][0] - 4.5).abs() < 1e-12
            && (pixels.sigma.unwrap()[0] - 0.125).abs() < 1e-12
    );
    let mut of_vic = mm.clone();
    of_vic["sigma"] = json!("px");
    let failed = spec(json!({ "sigma": "sigma" }), of_vic)
        .read(folder.path(), None)
        .unwrap();
    assert_eq!((failed.len(), failed.sigma), (96, None));
    // a residual of the correlation is taken for no coefficient
    fs::write(&path, text.replace(";0.9\n", ";0.02\n")).unwrap();
    let error = both.read(folder.path(), None).unwrap_err();
    assert!(
        error.to_string().contains("t.csv, column \"zncc\"")
            && error.hint_text().unwrap().contains("ZNSSD"),
        "{error}"
    );
    fs::write(&path, text.replace("-1;0.99", "bad;0.99")).unwrap();
    let error = both.read(folder.path(), None).unwrap_err().to_string();
    assert!(
        error.contains("t.csv:5, column \"sigma\": found bad"),
        "{error}"
    );
    for (units, word) in [
        (
            json!({ "coordinates": "px", "displacements": "mm" }),
            "units.mm_per_pixel",
        ),
        (
            json!({ "coordinates": "px", "displacements": "mm", "mm_per_pixel": -1 }),
            "above 0",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "mm", "mm_per_pixel": 1 }),
            "no such key",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "mm", "sigma": "mm" }),
            "units.sigma",
        ),
        (
            json!({ "coordinates": "mm", "displacements": "feet" }),
            "feet",
        ),
    ] {
        let keys = json!({
            "format": "csv", "file": "t.csv", "columns": { "x": "x", "y": "y", "ux": "u", "uy": "v" }, "units": units,
            "loading_axis": "x", "hole_center_in_data_mm": [0, 0],
        });
        let error = serde_json::from_value::<plychain::field::MeasurementSpec>(keys)
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn forces_stand_in_comments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    for (comment, force) in [
        ("# force : 15000.5", Some(15000.5)),
        ("#   Force [kN]: 15", Some(15000.0)),
        ("# time: 3\n# force = 1.5 kN", Some(1500.0)),
        ("# force_N: -20", Some(-20.0)),
        ("# force: None", None),
        ("# force: 3 kgf", None),
        ("# force max: 3", None),
        ("# enforced: 3", None),
        ("# force: inf", None),
        ("", None),
    ] {
        fs::write(
            &path,
            format!("{comment}\nx,y,dx,dy\n1,2,3,4\n# force: 7\n"),
        )
        .unwrap();
        assert_eq!(table::stated_force(&path).unwrap(), force, "{comment}");
    }
    // the node map of ARAMIS has its header behind a comment sign
    fs::write(
        &path,
        "# force : 3\n# index; x_undef [mm]; y_undef [mm]; u [mm]; v [mm]\n1; 2; 3; 4; 5\n",
    )
    .unwrap();
    let header = table::header(&path).unwrap();
    assert_eq!(
        header,
        ["index", "x_undef [mm]", "y_undef [mm]", "u [mm]", "v [mm]"]
    );
}

fn here(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = assert_cmd::Command::cargo_bin("plychain").unwrap();
    let output = command
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].map(|t| String::from_utf8_lossy(&t).into_owned());
    assert_ne!(output.status.code(), Some(2), "{text:?}");
    (output.status.success(), text.concat())
}

#[test]
fn init_proposes_a_series() {
    let case = Case::written();
    let folder = case.folder.path();
    // ten steps, of which the last is without load, two with their force in a comment
    for k in 1..10 {
        let force = 250.0 * k as f64;
        let text = csv(&grid(), &field(&grid(), force, k));
        let comment = if k % 5 == 0 {
            format!("# force: {force}\n")
        } else {
            String::new()
        };
        fs::write(folder.join(format!("load-{k}0.csv")), comment + &text).unwrap();
    }
    fs::write(
        folder.join("load-Unloaded.csv"),
        csv(&grid(), &field(&grid(), 0.0, 11)),
    )
    .unwrap();
    fs::write(
        folder.join("load-100.csv"),
        csv(&grid(), &field(&grid(), 2400.0, 12)),
    )
    .unwrap();
    let (done, said) = here(
        folder,
        &["init", "coupon", "--like", "steel", "--csv", "load-*.csv"],
    );
    assert!(done, "{said}");
    for words in [
        "11 steps with",
        "load-Unloaded.csv: force_N 0 (no load",
        "load-50.csv: force_N 1250 (stated",
        "load-10.csv: force_N null",
        "ratios",
    ] {
        assert!(said.contains(words), "\"{words}\" is missing in {said}");
    }
    let path = folder.join("coupon.json");
    let model = Model::load(&path).unwrap();
    let steps = model.experiment().steps.as_ref().unwrap();
    let files: Vec<PathBuf> = (1..10).map(|k| format!("load-{k}0.csv").into()).collect();
    let files: Vec<PathBuf> = files
        .into_iter()
        .chain(["load-100.csv".into(), "load-Unloaded.csv".into()])
        .collect();
    assert_eq!(
        steps.iter().map(|s| s.file.clone()).collect::<Vec<_>>(),
        files
    );
    assert_eq!(steps[4].force_n, Some(1250.0));
    assert_eq!((steps[0].force_n, steps[10].force_n), (None, Some(0.0)));
    let series = model.read_series().unwrap().unwrap();
    assert_eq!(series.steps.len(), 11);
    let written: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(
        written["experiments"][0]["measurement"]["loading_axis"],
        "y"
    );
    assert_eq!(written["experiments"][0]["load"], Value::Null);
    let again = serde_json::to_string(&model.file).unwrap();
    assert_eq!(
        serde_json::to_string(&Model::parse(&again, &path).unwrap().file).unwrap(),
        again
    );
    // the files one by one, as a shell gives them, and a pattern of none
    let (done, said) = here(
        folder,
        &[
            "init",
            "two",
            "--like",
            "steel",
            "--csv",
            "load-20.csv",
            "load-100.csv",
            "load-30.csv",
        ],
    );
    assert!(done && said.contains("3 steps with"), "{said}");
    let (done, said) = here(folder, &["init", "none", "--csv", "nothing-*.csv"]);
    assert!(
        !done && said.contains("nothing-*.csv") && said.contains("files of this pattern"),
        "{said}"
    );
    // columns that differ
    let odd = csv(&grid(), &field(&grid(), 900.0, 3)).replace("u_mm,v_mm", "ux_mm,uy_mm");
    fs::write(folder.join("load-20.csv"), odd).unwrap();
    let (done, said) = here(folder, &["init", "odd", "--csv", "load-?0.csv"]);
    assert!(
        !done && said.contains("load-20.csv") && !folder.join("odd.json").exists(),
        "{said}"
    );
}

#[test]
fn init_maps_sigma_correlation_and_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let try_header = |name: &str, header: &str, quality: &str, more: &[&str]| {
        let mut text = format!("{header}\n");
        for k in 0..400 {
            let (x, y) = (k % 20, k / 20);
            text += &format!("{x},{y},{},0,{quality}\n", 0.1 * f64::from(x));
        }
        fs::write(folder.path().join(format!("{name}.csv")), text).unwrap();
        let csv = format!("{name}.csv");
        let (done, said) = here(
            folder.path(),
            &[&["init", name, "--csv", &csv], more].concat(),
        );
        assert!(done, "{said}");
        let model = Model::load(&folder.path().join(format!("{name}.json"))).unwrap();
        let measurement = serde_json::to_value(&model.experiment().measurement).unwrap();
        (measurement, said)
    };
    let (vic, said) = try_header("vic", "x_c,y_c,u_c,v_c,sigma", "0.01", &[]);
    assert_eq!(
        (&vic["columns"]["sigma"], &vic["units"]["sigma"]),
        (&json!("sigma"), &json!("px"))
    );
    assert!(said.contains("in pixels"), "{said}");
    let (plain, said) = try_header("plain", "x_mm,y_mm,ux_mm,uy_mm,zncc", "0.99", &[]);
    assert_eq!(plain["columns"]["correlation"], "zncc");
    assert!(said.contains("below 0.9"), "{said}");
    // a measure that is 0 for a perfect match is not taken for a coefficient
    let (cost, said) = try_header("cost", "x_mm,y_mm,ux_mm,uy_mm,correlation", "0.01", &[]);
    assert_eq!(cost["columns"]["correlation"], Value::Null);
    assert!(said.contains("is not used"), "{said}");
    let (pixels, _) = try_header(
        "pixels",
        "COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA",
        "0.01",
        &["--mm-per-pixel", "0.05"],
    );
    assert_eq!(
        pixels["units"],
        json!({ "coordinates": "px", "displacements": "px", "sigma": "px", "mm_per_pixel": 0.05 })
    );
}

/// A series is read, and not yet identified: said by every verb that would have to.
#[test]
fn verbs_refuse_a_series_for_now() {
    let case = Case::written();
    let folder = case.folder.path();
    fs::write(folder.join("m.json"), case.model.to_string()).unwrap();
    for arguments in [
        &["identify", "m.json", "--out", "run"][..],
        &["loop", "m.json", "--out", "run"],
        &["build", "m.json", "--out", "run"],
        &["simulate", "m.json", "--out", "run"],
    ] {
        let (done, said) = here(folder, arguments);
        assert!(
            !done && said.contains("m.json: experiments[0].steps") && said.contains("yet"),
            "{arguments:?}: {said}"
        );
        assert!(!folder.join("run").exists());
    }
    let (done, said) = here(
        folder,
        &["loop", "m.json", "--data", "step-01.csv", "--out", "run"],
    );
    assert!(!done && said.contains("--data"), "{said}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn mangled_steps_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..30), cut in any::<prop::sample::Index>(), doubled in any::<bool>()) {
        let points: Vec<[f64; 2]> = grid().into_iter().step_by(5).collect();
        let forces = [500.0, 1000.0, 0.0];
        let case = Case::new(&forces.map(Some));
        for (k, force) in forces.into_iter().enumerate() {
            let mut bytes = csv(&points, &field(&points, force, k)).into_bytes();
            if k == 1 {
                for (place, byte) in &edits {
                    let place = place.index(bytes.len());
                    bytes[place] = if byte % 4 > 0 { byte & 0x7f } else { *byte };
                }
                let cut = cut.index(bytes.len());
                if doubled {
                    let piece = bytes[cut..].to_vec();
                    bytes.extend(piece);
                } else if cut % 3 == 0 {
                    bytes.truncate(cut);
                }
            }
            fs::write(case.folder.path().join(name(k)), bytes).unwrap();
        }
        match case.read() {
            Err(error) => prop_assert_eq!(error.blame(), Blame::Input),
            Ok(series) => {
                let finite = series.steps.iter().flat_map(|s| &s.displacement).flatten().all(|u| u.is_finite());
                prop_assert!(finite && series.steps.iter().all(|s| s.displacement.len() == series.field.len()));
            }
        }
    }
}

/// The model that an analyst writes for a reference series, by its `declared.json`.
fn declared(folder: &Path) -> Model {
    let text = fs::read_to_string(folder.join("declared.json")).unwrap();
    let declared: Value = serde_json::from_str(&text).unwrap();
    let mut case = Case::new(&[None]);
    let experiment = &mut case.model["experiments"][0];
    experiment["specimen"] = declared["specimen"].clone();
    experiment["steps"] = declared["steps"].clone();
    experiment["measurement"]["image_correlation"] = declared["image_correlation"].clone();
    if declared["material"] == "ply" {
        let parameters = ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"].map(|name| {
            (
                name.to_string(),
                json!({ "prior": { "normal": declared["prior"][name] } }),
            )
        });
        case.model["material"] =
            json!({ "kind": "ply", "parameters": serde_json::Map::from_iter(parameters) });
    }
    Model::parse(&case.model.to_string(), &folder.join("m.json")).unwrap()
}

/// The series of an independent simulation: read whole, nothing objected; with two forces interchanged, objected.
#[test]
#[ignore = "needs ../shared"]
fn the_reference_series_are_read() {
    for name in [
        "still",
        "tilt-with-load",
        "lens",
        "yield",
        "hole-and-approach",
    ] {
        let folder = shared("dic-reference").join(name);
        let model = declared(&folder);
        let series = model.read_series().unwrap().unwrap();
        println!(
            "{name}: {} points, {:?}",
            series.field.len(),
            series.field.rejected
        );
        assert_eq!(series.warnings, Vec::<String>::new(), "{name}");
        assert!(series.steps.iter().all(|s| s.lost == 0));
        assert!(series.field.rejected.outliers < series.field.len() / 200);
        for [a, b] in [[0, 1], [1, 2], [2, 3], [0, 3], [0, 4], [3, 4]] {
            let mut shuffled = model.clone();
            let steps = shuffled.experiment_mut().steps.as_mut().unwrap();
            (steps[a].force_n, steps[b].force_n) = (steps[b].force_n, steps[a].force_n);
            let error = shuffled.read_series().err();
            let error = error.unwrap_or_else(|| panic!("{name}: forces {a} and {b} interchanged"));
            assert!(error.to_string().contains("larger force"), "{error}");
        }
    }
    // a step of another specimen: other points
    let mut mixed = declared(&shared("dic-reference").join("still"));
    let other = shared("dic-reference").join("tilt-with-load/step-02.csv");
    mixed.experiment_mut().steps.as_mut().unwrap()[1].file = other;
    let error = mixed.read_series().err().unwrap().to_string();
    assert!(error.contains("tilt-with-load/step-02.csv"), "{error}");
}

/// The real series: the forces are not known, points differ a little between the steps.
#[test]
#[ignore = "needs ../shared"]
fn the_real_series_is_read() {
    let folder = shared("cfrp-open-hole");
    let files = [1, 2, 3, 5, 7].map(|k| folder.join(format!("step-{k:02}.csv")));
    let mut case = Case::new(&[None]);
    let experiment = &mut case.model["experiments"][0];
    experiment["measurement"]["columns"]["correlation"] = json!("zncc");
    experiment["specimen"]["width_mm"] = json!(30.0);
    experiment["specimen"]["hole"]["diameter_mm"] = json!(10.03);
    // with forces in proportion to the strains that the README states, too
    for forces in [
        [
            Value::Null,
            Value::Null,
            Value::Null,
            Value::Null,
            Value::Null,
        ],
        [
            json!(570),
            json!(1230),
            json!(2000),
            json!(3500),
            json!(5200),
        ],
    ] {
        let steps = files
            .iter()
            .zip(forces)
            .map(|(file, force)| json!({ "file": file, "force_N": force }));
        case.model["experiments"][0]["steps"] = steps.collect();
        let series = case.read().unwrap();
        println!("{} points, {:?}", series.field.len(), series.field.rejected);
        assert_eq!(series.warnings, Vec::<String>::new());
        assert!(series.field.len() > 16_000);
        for step in &series.steps {
            println!(
                "{}: lost {}, outliers {}",
                step.name, step.lost, step.outliers
            );
            assert!(step.lost < 200);
        }
    }
}

/// `init` on real files: columns, correlation, hole, axis, steps.
#[test]
#[ignore = "needs ../shared"]
fn init_proposes_the_real_series() {
    let folder = tempfile::tempdir().unwrap();
    let pattern = shared("cfrp-open-hole")
        .join("step-*.csv")
        .display()
        .to_string();
    let (done, said) = here(folder.path(), &["init", "coupon", "--csv", &pattern]);
    println!("{said}");
    assert!(
        done && said.contains("5 steps with") && said.contains("zncc"),
        "{said}"
    );
    let model = Model::load(&folder.path().join("coupon.json")).unwrap();
    assert_eq!(model.experiment().steps.as_ref().unwrap().len(), 5);
}
