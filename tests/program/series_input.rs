//! Load series as they come in: the model's steps, fields matched point by point, what is refused and what is said, and what `init`
//! proposes.

use std::fs;
use std::path::Path;

use plychain::error::{Blame, Error};
use plychain::field::Series;
use plychain::infer::Model;
use serde_json::{Value, json};

use crate::common::root;

mod columns;
mod forces;
mod init;
mod refused;
mod shared;

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

/// A file may state another force than the model: the model's counts, and it is said. Steps that are all without load are none.
#[test]
fn forces_that_contradict_their_files_or_are_all_zero_are_said() {
    let mut case = Case::written();
    let text = csv(&grid(), &field(&grid(), FORCES[1], 1));
    case.write(1, &format!("# force : {}\n{text}", FORCES[1]));
    assert!(case.read().unwrap().warnings.is_empty());
    case.write(1, &format!("# force [kN] : {}\n{text}", FORCES[1]));
    let warnings = case.read().unwrap().warnings;
    let [only] = &warnings[..] else {
        panic!("{warnings:?}")
    };
    assert!(
        only.contains("step-02.csv") && only.contains("the model's is taken"),
        "{only}"
    );
    case.set_forces(&[0.0; 5]);
    let error = case.parse().err().unwrap().to_string();
    assert!(error.contains("0 in all of them"), "{error}");
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
    assert_eq!(series.warnings.len(), 5, "{:?}", series.warnings);
    let lacks = format!("it lacks {missing} of the");
    let odd = |w: &&String| w.contains("step-02.csv") && w.contains(&lacks);
    assert_eq!(series.warnings.iter().filter(odd).count(), 1);
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
