//! Model files: errors with the keys as they stand, other versions, and keys of experiments to come.

use std::path::Path;

use plychain::infer::{Model, problem_within};
use serde_json::{Value, json};

use crate::common::root;

fn text(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap()
}

fn parse(text: &str) -> Result<Model, String> {
    Model::parse(text, Path::new("m.json")).map_err(|e| e.to_string())
}

/// The default model after `change`.
fn changed(change: impl Fn(&mut Value)) -> Result<Model, String> {
    let mut file: Value = serde_json::from_str(&text("models/openhole.json")).unwrap();
    change(&mut file);
    parse(&serde_json::to_string_pretty(&file).unwrap())
}

/// An error has the key as it stands in the file that is wrong.
#[test]
fn errors_name_the_keys_of_the_file() {
    for (from, to, key) in [
        (
            r#""sd": 0.75"#,
            r#""sd": -0.75"#,
            "m.json: material.parameters.E2_GPa.prior.normal.sd: ",
        ),
        (
            r#""width_mm": 25.0"#,
            r#""width_mm": -25.0"#,
            "m.json: experiments[0].specimen.width_mm: ",
        ),
        (
            r#""width_mm": 25.0"#,
            r#""width_mm": "wide""#,
            ": experiments[0].specimen.width_mm: ",
        ),
        (
            r#""gauge": "window""#,
            r#""gauge": "window", "gauge": "window""#,
            "duplicate field `gauge`",
        ),
        (
            r#""gauge": "window""#,
            r#""mesh_density": 0, "gauge": "window""#,
            "m.json: experiments[0].mesh_density: ",
        ),
    ] {
        let text = text("models/openhole.json");
        assert!(text.contains(from), "{from}");
        let error = parse(&text.replace(from, to)).err().unwrap();
        assert!(error.contains(key), "{key} is missing in {error}");
    }
    let error = parse(r#"{ "schema": "plychain-model/3", "material": 1 }"#).err();
    let error = error.unwrap();
    assert!(error.contains("schema: found plychain-model/3"), "{error}");
    assert!(error.contains("plychain-model/2"), "{error}");
}

/// Keys whose meaning is fixed but that nothing reads yet are refused rather than passed over.
#[test]
fn what_is_not_built_yet_is_refused_by_its_key() {
    let error = changed(|m| m["experiments"][0]["kind"] = json!("frequencies")).err();
    let error = error.unwrap();
    assert!(
        error.contains("experiments[0].kind: found ") && error.contains("yet"),
        "{error}"
    );
    assert!(error.starts_with("m.json:"), "no line in {error}");
    for count in [0, 2] {
        let error = changed(|m| {
            let one = m["experiments"][0].clone();
            m["experiments"] = vec![one; count].into();
        });
        let error = error.err().unwrap();
        assert!(
            error.contains("m.json: experiments: found") && error.contains("one field"),
            "{error}"
        );
    }
}

#[test]
fn a_mesh_stands_in_place_of_the_strip_s_dimensions() {
    let mesh = json!({ "file": "plate.msh", "load": { "edge": "high", "direction": [0, 1] } });
    let with = |dimensions: bool, mesh: &serde_json::Value| {
        changed(|m| {
            let experiment = &mut m["experiments"][0];
            experiment["mesh"] = mesh.clone();
            if !dimensions {
                let specimen = experiment["specimen"].as_object_mut().unwrap();
                specimen.retain(|key, _| ["layup_deg", "thickness_mm"].contains(&key.as_str()));
            }
        })
        .err()
        .unwrap()
    };
    assert!(with(true, &mesh).contains("specimen.length_mm: found one, expected no such key"));
    assert!(
        with(false, &mesh).contains("plate.msh"),
        "{}",
        with(false, &mesh)
    );
    let unloaded = with(false, &json!({ "file": "plate.msh" }));
    assert!(
        unloaded.contains("mesh") && unloaded.contains("load"),
        "{unloaded}"
    );
}

#[test]
fn the_mesh_is_as_dense_as_declared() {
    let elements = |model: &Model| {
        let problem = problem_within(model, [[-12.0; 2], [12.0; 2]], None).unwrap();
        problem.experiment.mesh_size()[0] as f64
    };
    let coarse = changed(|m| m["experiments"][0]["mesh_density"] = 0.5.into()).unwrap();
    let default = changed(|_| ()).unwrap();
    let ratio = elements(&coarse) / elements(&default);
    assert!((ratio - 0.25).abs() < 0.03, "{ratio}");
}
