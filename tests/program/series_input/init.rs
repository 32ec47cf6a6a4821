//! What `init` makes of a series, and what the verbs say to one.

use std::fs;
use std::path::{Path, PathBuf};

use plychain::infer::Model;
use serde_json::{Value, json};

use super::{Case, csv, field, grid};
use crate::common::{plychain_in, root, shared};

fn here(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = plychain_in(folder, arguments);
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
    let single = ["init", "single", "--like", "steel", "--csv", "load-50.csv"];
    let (done, alone) = here(folder, &single);
    assert!(done && alone.contains("load.force_N 1250"), "{alone}");
    let model = Model::load(&folder.join("single.json")).unwrap();
    assert_eq!(model.experiment().nominal_load().force_n, 1250.0);
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
    assert!(!done && said.contains("load-20.csv"), "{said}");
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

/// No data take the place of a series' steps.
#[test]
fn what_a_series_cannot_do_is_said() {
    let case = Case::written();
    let folder = case.folder.path();
    fs::write(folder.join("m.json"), case.model.to_string()).unwrap();
    let (done, said) = here(
        folder,
        &["loop", "m.json", "--data", "step-01.csv", "--out", "run"],
    );
    assert!(!done && said.contains("--data"), "{said}");
    assert!(!folder.join("run").exists());
}

/// The commands of models/README.md for a user's own series, up to the loop: what is simulated is proposed as it is.
#[test]
fn the_readmes_own_series_is_simulated_and_proposed() {
    let readme = fs::read_to_string(root().join("models/README.md")).unwrap();
    let (_, page) = readme.split_once("## Load series").unwrap();
    let (_, commands) = page.split_once("```sh").unwrap();
    let (commands, _) = commands.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut done = 0;
    for line in commands.lines().filter(|l| l.starts_with("plychain")) {
        let line = line.split(" #").next().unwrap();
        let words = line.split_whitespace().skip(1);
        let words: Vec<&str> = words.map(|w| w.trim_matches('\'')).collect();
        if ["init", "simulate"].contains(&words[0]) {
            let (fine, said) = here(folder.path(), &words);
            assert!(fine, "{line}: {said}");
            done += 1;
        }
    }
    assert_eq!(done, 3);
    let model = Model::load(&folder.path().join("coupon.json")).unwrap();
    let simulated = Model::load(&folder.path().join("series/model.json")).unwrap();
    let forces = |m: &Model| -> Vec<Option<f64>> {
        let steps = m.experiment().steps.as_ref().unwrap();
        steps.iter().map(|s| s.force_n).collect()
    };
    assert_eq!(forces(&model), forces(&simulated));
    let images = |m: &Model| m.experiment().measurement.image_correlation;
    assert!(images(&model).is_some() && images(&model) == images(&simulated));
    // the hole beside whole subsets, whose gap is wider, to a third of their spacing
    let hole = model.experiment().specimen.hole.as_ref().unwrap();
    assert!(
        (3.85..4.15).contains(&hole.diameter_mm),
        "{}",
        hole.diameter_mm
    );
    assert!(hole.center_mm.iter().all(|c| c.abs() < 0.1));
    let series = model.read_series().unwrap().unwrap();
    assert!(series.warnings.is_empty(), "{:?}", series.warnings);
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
