//! Inputs of which no reduced model can be made end in an error that says what to change.

use std::path::Path;
use std::sync::Arc;

use plychain::error::Error;
use plychain::experiment::FieldExperiment;
use plychain::infer::Model;
use plychain::reduce::{Choice, Modes, ReducedSpec, Surface, Variables};

use super::{points, scene, small_problem, small_test};

/// The error's text and hint, which must be the input's fault.
fn told(error: &Error) -> String {
    assert_eq!(error.exit_code(), 1);
    format!("{error} | {}", error.hint_text().unwrap_or(""))
}

fn fit(fitted: &[Vec<f64>]) -> Error {
    let variables = Variables::new(Choice::Plain, &small_problem(), fitted);
    let values = vec![vec![1.0; fitted.len()]];
    Surface::fit(variables, 3, fitted, &values).unwrap_err()
}

#[test]
fn fewer_samples_than_monomials() {
    let mut problem = small_problem();
    problem.spec.snapshots = 50;
    let before_solving = told(&problem.validate().unwrap_err());
    let text = told(&fit(&points(&small_problem(), 50, 1)));
    assert_eq!(before_solving, text);
    for part in [
        "reduced_model.snapshots",
        "found 50",
        "at least 57",
        "lower degree",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn a_design_without_length_in_one_direction() {
    let mut flat = points(&small_problem(), 80, 1);
    for p in &mut flat {
        p[2] = 0.3;
    }
    let text = told(&fit(&flat));
    assert!(
        text.contains("rank-deficient") && text.contains("DoE bound"),
        "{text}"
    );

    let mut problem = small_problem();
    problem.dimensions[2].low = problem.dimensions[2].high;
    let text = told(&problem.validate().unwrap_err());
    assert!(
        text.contains("reduced_model.doe.nu12") && text.contains("[0.42, 0.42]"),
        "{text}"
    );
}

#[test]
fn a_corner_without_a_positive_definite_ply() {
    let mut problem = small_problem();
    (problem.dimensions[0].low, problem.dimensions[1].high) = (20.0, 130.0);
    let text = told(&problem.validate().unwrap_err());
    for part in [
        "corner of the DoE box",
        "nu12^2 < E1/E2",
        "narrow the priors",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

/// The default model's text with one piece replaced.
fn edited(old: &str, new: &str) -> Error {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/openhole.json");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(old));
    Model::parse(&text.replace(old, new), &path).err().unwrap()
}

#[test]
fn a_hole_that_touches_the_edge() {
    let text = told(&edited(
        r#""center_mm": [0.0, 0.0]"#,
        r#""center_mm": [0.0, 10.5]"#,
    ));
    for part in [
        "specimen.hole",
        "stays clear of the plate's edge",
        "hole.center_mm",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn modes_are_a_number_or_auto() {
    let text = told(&edited(r#""modes": 4"#, r#""modes": "most""#));
    assert!(
        text.contains("a whole number of modes, or \"auto\""),
        "{text}"
    );
    let text = told(&edited(r#""modes": 4"#, r#""modes": 0"#));
    assert!(
        text.contains("reduced_model.modes") && text.contains("from 1 to 30"),
        "{text}"
    );
    let read: ReducedSpec =
        serde_json::from_str(r#"{ "snapshots": 200, "modes": "auto", "degree": 3 }"#).unwrap();
    assert_eq!(read.modes, Modes::Auto);
    let written = serde_json::to_string(&read).unwrap();
    assert_eq!(written, r#"{"snapshots":200,"modes":"auto","degree":3}"#);
}

#[test]
fn a_reference_needs_a_laminate() {
    let mut problem = small_problem();
    problem.spec = serde_json::from_str(
        r#"{ "snapshots": 200, "modes": 4, "degree": 3, "reference": "gogu-2013" }"#,
    )
    .unwrap();
    problem.validate().unwrap();
    let published = problem.of_reference(problem.spec.reference.unwrap());
    assert_eq!(published.dimensions[4].low, 6.0 * 0.12);
    published.validate().unwrap();
    let test = small_test();
    let mut scene = scene(&test);
    scene.material = plychain::laminate::Material::Isotropic;
    problem.experiment = Arc::new(FieldExperiment::new(test, scene).unwrap());
    assert!(told(&problem.validate().unwrap_err()).contains("reduced_model.reference"));
}
