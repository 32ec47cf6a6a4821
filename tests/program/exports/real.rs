//! The files of `../shared/data/field-files`, one test a folder: what its README says is right.

use std::path::PathBuf;

use serde_json::Value;

use super::{measurement, said};
use crate::common::shared;

/// `init` on files of a folder: whether it was content, what it said, and the model.
fn init(folder: &str, files: &str, more: &[&str]) -> (bool, String, Value) {
    let place: PathBuf = shared("field-files").join(folder).join(files);
    let here = tempfile::tempdir().unwrap();
    let place = place.display().to_string();
    let (done, text) = said(
        here.path(),
        &[&["init", "a", "--csv", &place], more].concat(),
    );
    let model = std::fs::read_to_string(here.path().join("a.json")).unwrap_or_default();
    (done, text, serde_json::from_str(&model).unwrap_or_default())
}

fn all_points(folder: &str, file: &str, more: &[&str], label: &str) -> Value {
    let (done, text, model) = init(folder, file, more);
    assert!(
        done && text.contains("616 points") && text.contains(label),
        "{folder}/{file}: {text}"
    );
    model
}

#[test]
#[ignore = "needs ../shared"]
fn gom_stage_block() {
    all_points(
        "gom-stage-block",
        "stage.csv",
        &[],
        "columns of ARAMIS / GOM",
    );
}

#[test]
#[ignore = "needs ../shared"]
fn nodemap_latin1() {
    all_points(
        "nodemap-latin1",
        "nodemap.txt",
        &[],
        "columns of ARAMIS / GOM (nodemap export)",
    );
}

#[test]
#[ignore = "needs ../shared"]
fn vic_spaced_quotes() {
    for (file, label) in [
        ("vic2d.csv", "VIC-2D (calibrated)"),
        ("vic3d.csv", "VIC-3D"),
    ] {
        let model = all_points("vic-spaced-quotes", file, &[], label);
        assert!(
            !measurement(&model)["columns"]["x"]
                .as_str()
                .unwrap()
                .contains('"')
        );
    }
}

#[test]
#[ignore = "needs ../shared"]
fn decimal_comma() {
    for file in ["semicolon.csv", "quoted.csv"] {
        all_points("decimal-comma", file, &[], "decimal commas");
    }
}

#[test]
#[ignore = "needs ../shared"]
fn missing_value_words() {
    for file in ["hash_na.csv", "msvc.csv", "na.csv", "null.csv"] {
        let (done, text, _) = init("missing-value-words", file, &[]);
        assert!(done && text.contains("without a value"), "{file}: {text}");
    }
}

#[test]
#[ignore = "needs ../shared"]
fn tables_of_other_programs() {
    for file in [
        "matchid-image.csv",
        "preamble.csv",
        "fortran-d.csv",
        "latin1-header.csv",
        "utf16.csv",
        "whitespace.txt",
        "comsol.csv",
        "units-row.csv",
        "davis10.txt",
        "slash-units.csv",
        "tecplot.dat",
        "unicode-minus.csv",
        "curly-quotes.csv",
        "trailing-delimiter.csv",
        "sep-line.csv",
    ] {
        all_points("tables-of-other-programs", file, &[], "coordinates in mm");
    }
    all_points(
        "tables-of-other-programs",
        "pyaldic.csv",
        &["--mm-per-pixel", "0.05"],
        "pyALDIC",
    );
    let (done, text, _) = init("tables-of-other-programs", "x-y-ux-uy.csv", &[]);
    assert!(
        !done && text.contains("x-y-ux-uy.csv:1") && text.contains("--units mm"),
        "{text}"
    );
    all_points(
        "tables-of-other-programs",
        "x-y-ux-uy.csv",
        &["--units", "mm"],
        "plain table",
    );
}

#[test]
#[ignore = "needs ../shared"]
fn pixels_called_xyuv() {
    for file in ["opencorr.csv", "vic2d-uncalibrated.csv"] {
        let model = all_points(
            "pixels-called-xyuv",
            file,
            &["--mm-per-pixel", "0.05"],
            "coordinates in px",
        );
        let hole = model["experiments"][0]["specimen"]["hole"]["diameter_mm"]
            .as_f64()
            .unwrap();
        assert!((3.5..4.6).contains(&hole), "{file}: {hole}");
        let (done, text, _) = init("pixels-called-xyuv", file, &[]);
        assert!(!done && text.contains("--mm-per-pixel"), "{text}");
    }
}

#[test]
#[ignore = "needs ../shared"]
fn sigma_zero() {
    all_points(
        "sigma-zero",
        "dice.txt",
        &["--mm-per-pixel", "0.05"],
        "sigma is 0 everywhere",
    );
}

#[test]
#[ignore = "needs ../shared"]
fn current_coordinates() {
    let (done, text, model) = init("current-coordinates", "s*.csv", &[]);
    assert!(
        done && text.contains("3 steps with 616 points in common"),
        "{text}"
    );
    assert_eq!(measurement(&model)["columns"]["deformed"], true);
}

#[test]
#[ignore = "needs ../shared"]
fn incremental_steps() {
    let (_, text, _) = init("incremental-steps", "step-*.csv", &[]);
    assert!(
        text.contains("incremental") && text.contains("one reference picture"),
        "{text}"
    );
}

#[test]
#[ignore = "needs ../shared"]
fn init_wide_plate() {
    let (done, text, model) = init("init-wide-plate", "plate.csv", &[]);
    let specimen = &model["experiments"][0]["specimen"];
    let hole = specimen["hole"]["diameter_mm"].as_f64().unwrap();
    assert!(
        done && (24.0..26.0).contains(&hole) && text.contains("width_mm"),
        "{hole}: {text}"
    );
    assert!(specimen["width_mm"].as_f64().unwrap() >= 58.0);
}

/// The reference picture among the steps is left out of the loop.
#[test]
#[ignore = "needs ../shared"]
fn reference_step() {
    let place = shared("field-files").join("reference-step");
    let model = plychain::infer::Model::load(&place.join("model.json")).unwrap();
    let series = model.read_series().unwrap().unwrap();
    assert_eq!(series.steps.len(), 4);
    assert!(
        series
            .warnings
            .iter()
            .any(|w| w.contains("step-00") && w.contains("left out")),
        "{:?}",
        series.warnings
    );
}
