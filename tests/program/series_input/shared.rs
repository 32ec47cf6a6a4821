//! Series of an independent simulation, and a real one.

use std::fs;
use std::path::Path;

use plychain::infer::Model;
use serde_json::{Value, json};

use super::Case;
use crate::common::shared;

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
        // the lens strains the picture, by millimetres of motion, as much as half a step of load does
        let pairs: &[[usize; 2]] = match name {
            "lens" => &[[0, 3], [1, 3], [3, 4]],
            _ => &[[0, 1], [1, 2], [2, 3], [0, 3], [0, 4], [3, 4]],
        };
        for &[a, b] in pairs {
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
