//! The command line: what a user sees when the input is wrong, and that nothing half-written stays.

use std::path::Path;

use serde_json::Value;

use crate::common::{coarse, copy, fresh, model, plychain, root, succeed};

/// Run and expect exit code 1 with one line that holds all of `words`, and that `out` was not left behind.
fn refuse(arguments: &[&str], out: &Path, words: &[&str]) {
    let mut all = arguments.to_vec();
    all.extend(["--out", out.to_str().unwrap()]);
    let output = plychain(&all);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{all:?}\n{errors}");
    let line = errors
        .lines()
        .find(|l| l.starts_with("error: "))
        .unwrap_or_else(|| panic!("no error line in\n{errors}"));
    for word in words {
        assert!(line.contains(word), "{word:?} is missing in\n{errors}");
    }
    assert!(!out.exists(), "{} was left behind", out.display());
}

/// A model file with some text replaced.
fn changed(from: &str, to: &str) -> String {
    let text = std::fs::read_to_string(model("openhole.json")).unwrap();
    assert!(text.contains(from), "{from} is not in the model");
    let file = fresh("broken.json");
    std::fs::write(&file, text.replace(from, to)).unwrap();
    file.display().to_string()
}

#[test]
fn a_broken_model_is_named_with_file_key_value_and_expectation() {
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "\"gauge\": \"window\"",
            "\"gauge\": \"window\", \"colour\": 1",
            &["broken.json", "colour", "expected"],
        ),
        (
            "\"width_mm\": 25.0,",
            "",
            &["broken.json", "specimen", "width_mm"],
        ),
        (
            "\"width_mm\": 25.0",
            "\"width_mm\": \"wide\"",
            &["broken.json", "specimen.width_mm", "wide", "f64"],
        ),
        (
            "\"mean\": 7.58, \"sd\": 0.75",
            "\"mean\": 7.58, \"sd\": -0.75",
            &[
                "broken.json",
                "parameters.E2_GPa.prior.normal.sd",
                "-0.75",
                "above 0",
            ],
        ),
        (
            "\"mean\": 0.34, \"sd\": 0.03",
            "\"mean\": 5.0, \"sd\": 0.03",
            &["broken.json", "nu12", "E1/E2"],
        ),
        (
            "[45, -45, 0, 0, -45, 45]",
            "[]",
            &["broken.json", "layup_deg", "[]", "at least one"],
        ),
        (
            "\"diameter_mm\": 4.0",
            "\"diameter_mm\": 25.0",
            &["broken.json", "specimen.hole", "25"],
        ),
        (
            "\"center_mm\": [0.0, 0.0]",
            "\"center_mm\": [0.0, 11.0]",
            &["broken.json", "specimen.hole", "11"],
        ),
        (
            "plychain-model/2",
            "plychain-model/7",
            &["broken.json", "schema", "plychain-model/7"],
        ),
        (
            "[\"rigid_translation\"]",
            "[\"rigid_body\"]",
            &[
                "broken.json",
                "rigid_body",
                "rigid_translation",
                "load_misalignment",
            ],
        ),
        (
            "\"gauge\": \"window\"",
            "\"gauge\": { \"zero_at_mm\": [0.5, -0.5] }",
            &[
                "broken.json",
                "gauge.zero_at_mm",
                "[0.5, -0.5]",
                "in the hole",
                "1.293 mm from its edge",
            ],
        ),
        (
            "\"gauge\": \"window\"",
            "\"gauge\": { \"zero_at_mm\": [13.0, 0.0] }",
            &[
                "broken.json",
                "gauge.zero_at_mm",
                "beyond the plate's edges",
            ],
        ),
        (
            "\"gauge\": \"window\"",
            "\"gauge\": \"window\", \"window_mm\": [[10, 10], [2, 20]]",
            &[
                "broken.json: experiments[0].window_mm",
                "[[10.0, 10.0], [2.0, 20.0]]",
                "x0 < x1",
            ],
        ),
        ("\"nu12\": {", "\"nu13\": {", &["broken.json", "nu13"]),
        (
            "\"snapshots\": 200",
            "\"snapshots\": 30",
            &["snapshots", "30", "at least"],
        ),
        (
            "\"mean\": 4.41, \"sd\": 0.5",
            "\"mean\": 4.41, \"sd\": \"x\"",
            &["broken.json", "G12_GPa"],
        ),
    ];
    for (from, to, words) in cases {
        let file = changed(from, to);
        let data = root().join("models/openhole").display().to_string();
        refuse(&["identify", &file, "--data", &data], &fresh("out"), words);
    }
    refuse(
        &["identify", "no-such-model.json"],
        &fresh("out"),
        &["no-such-model.json"],
    );
}

/// The sample measurement with one of its files changed.
fn data_with(name: &str, change: impl Fn(String) -> String) -> String {
    let folder = fresh("data");
    std::fs::create_dir(&folder).unwrap();
    for file in ["X.txt", "Y.txt", "U.txt", "V.txt"] {
        let text = std::fs::read_to_string(root().join("models/openhole").join(file)).unwrap();
        let text = if file == name { change(text) } else { text };
        std::fs::write(folder.join(file), text).unwrap();
    }
    folder.display().to_string()
}

/// Every number of a matrix multiplied.
fn scaled(text: &str, factor: f64) -> String {
    text.lines()
        .map(|line| {
            line.split_whitespace()
                .map(|v| format!("{}", v.parse::<f64>().unwrap() * factor))
                .collect::<Vec<_>>()
                .join(" ")
                + "\n"
        })
        .collect()
}

#[test]
fn broken_matrices_are_named_with_file_and_place() {
    type Change = Box<dyn Fn(String) -> String>;
    let cases: Vec<(&str, Change, &[&str])> = vec![
        (
            "V.txt",
            Box::new(|t| t.lines().skip(1).map(|l| format!("{l}\n")).collect()),
            &["V.txt", "120", "121"],
        ),
        (
            "U.txt",
            Box::new(|t| t.replacen("NaN", "banana", 1)),
            &["U.txt", "banana", "number"],
        ),
        ("U.txt", Box::new(|_| String::new()), &["U.txt"]),
        (
            "V.txt",
            Box::new(|t| {
                t.split_whitespace()
                    .map(|_| "NaN")
                    .collect::<Vec<_>>()
                    .chunks(121)
                    .map(|c| c.join(" ") + "\n")
                    .collect()
            }),
            &["V.txt"],
        ),
    ];
    for (name, change, words) in cases {
        let data = data_with(name, change);
        refuse(
            &["identify", &coarse(), "--data", &data],
            &fresh("out"),
            words,
        );
    }
    let nowhere = fresh("nowhere").display().to_string();
    refuse(
        &["identify", &model("openhole.json"), "--data", &nowhere],
        &fresh("out"),
        &["nowhere"],
    );
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_time_limit_that_leaves_no_draws_is_refused_in_words() {
    for verb in ["identify", "loop"] {
        let out = fresh("out");
        let place = out.to_str().unwrap();
        let output = plychain(&[verb, &coarse(), "--time-limit", "0.001", "--out", place]);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{errors}");
        for word in ["--time-limit", "0 draws", "at least 4"] {
            assert!(errors.contains(word), "{word:?} is missing in\n{errors}");
        }
        // its warm-up is there to go on with
        let goes_on = format!("--out {place} --resume");
        assert!(
            out.join("checkpoint").exists() && errors.contains(&goes_on),
            "{errors}"
        );
    }
}

/// A folder that cannot be traced is refused before any work, with the file that says so.
#[test]
#[ignore = "slow: run by .ci/run"]
fn runs_that_cannot_be_traced_are_refused_at_once() {
    let run = fresh("run");
    copy(crate::report::run(), &run);
    let traced = |file: &str, key: &str, value: Value, words: &[&str]| {
        let path = run.join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut json: Value = serde_json::from_str(&text).unwrap();
        *json.pointer_mut(key).unwrap() = value;
        std::fs::write(&path, json.to_string()).unwrap();
        let output = plychain(&["trace", run.to_str().unwrap()]);
        std::fs::write(&path, text).unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(!said.contains("tracing"), "{said}");
        for word in words {
            assert!(said.contains(word), "{word:?} is missing in\n{said}");
        }
    };
    let schema = "plychain-model/0".into();
    traced(
        "model.json",
        "/schema",
        schema,
        &["model.json", "identified anew"],
    );
    let effects = serde_json::json!(["rigid_translation", "rigid_rotation"]);
    traced(
        "model.json",
        "/experiments/0/effects",
        effects,
        &["report.json", "rigid_rotation", "belong"],
    );
    let schema = "plychain-report/0".into();
    traced(
        "report.json",
        "/schema",
        schema,
        &["report.json", "plychain-report/1"],
    );
    traced(
        "run.json",
        "/inputs_sha256",
        Value::Null,
        &["run.json", "inputs_sha256", "interrupted"],
    );
}

#[test]
fn wrong_units_and_axes_are_noticed() {
    for factor in [20.0, 0.05, -1.0] {
        let data = data_with("U.txt", |t| scaled(&t, factor));
        let folder = Path::new(&data);
        let v = std::fs::read_to_string(folder.join("V.txt")).unwrap();
        std::fs::write(folder.join("V.txt"), scaled(&v, factor)).unwrap();
        refuse(
            &["identify", &coarse(), "--data", &data],
            &fresh("out"),
            &["displacements", "times"],
        );
    }
    let model_file = changed(
        "\"loading_axis\": \"y\"",
        "\"loading_axis\": \"y\", \"hole_center_in_data_mm\": [5.0, 5.0]",
    );
    let data = root().join("models/openhole").display().to_string();
    refuse(
        &["identify", &model_file, "--data", &data],
        &fresh("out"),
        &["hole", "points"],
    );
}

#[test]
fn a_table_without_a_declared_column_lists_what_there_is() {
    let table = fresh("table.csv");
    std::fs::write(&table, "x,y,u\n1,2,3\n").unwrap();
    refuse(
        &[
            "identify",
            &model("steel-s235.json"),
            "--data",
            table.to_str().unwrap(),
        ],
        &fresh("out"),
        &["table.csv", "x-coordinate [mm]"],
    );
}

#[test]
fn places_that_cannot_be_written_are_refused_before_the_work() {
    let existing = fresh("existing");
    std::fs::create_dir(&existing).unwrap();
    std::fs::write(existing.join("precious.txt"), "keep").unwrap();
    let output = plychain(&["identify", &coarse(), "--out", existing.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("does not exist yet")
    );
    assert_eq!(
        std::fs::read_to_string(existing.join("precious.txt")).unwrap(),
        "keep"
    );
    let below_a_file = existing.join("precious.txt").join("run");
    refuse(
        &["identify", &coarse()],
        &below_a_file,
        &["precious.txt", "written"],
    );
}

#[test]
fn bad_arguments_of_simulate_are_refused() {
    let file = coarse();
    let cases: &[(&[&str], &[&str])] = &[
        (
            &["--effect", "load_missalignment=1"],
            &["load_missalignment", "load_misalignment"],
        ),
        (
            &["--effect", "load_misalignment=much"],
            &["load_misalignment", "much"],
        ),
        (
            &["--effect", "rigid_translation=1"],
            &["rigid_translation", "tx_um"],
        ),
        (&["--effect", "load_misalignment=90"], &["90", "20"]),
        (&["--set", "E3_GPa=1"], &["E3_GPa", "E1_GPa"]),
        (&["--set", "nu12=9"], &["nu12", "E1/E2"]),
        (&["--noise-nm=-1"], &["noise-nm", "-1"]),
    ];
    for (arguments, words) in cases {
        let mut all = vec!["simulate", file.as_str()];
        all.extend(*arguments);
        refuse(&all, &fresh("out"), words);
    }
}

#[test]
fn build_prints_the_error_tables_and_writes_the_model() {
    let out = fresh("build");
    let text = succeed(&[
        "build",
        &coarse(),
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ]);
    for word in ["eps", "PRESS", "R^2", "DoE"] {
        assert!(text.contains(word), "{word} is missing in\n{text}");
    }
    assert!(out.join("reduced_model.json").exists());
}

/// The sample measurement is what the command in models/README.md makes.
#[test]
fn the_sample_is_made_by_the_readmes_command() {
    let readme = std::fs::read_to_string(root().join("models/README.md")).unwrap();
    let command = readme
        .lines()
        .find(|l| l.starts_with("plychain simulate --effect"))
        .unwrap();
    let out = fresh("sample");
    let arguments: Vec<&str> = command.split_whitespace().skip(1).collect();
    let end = arguments.iter().position(|a| *a == "--out").unwrap();
    let file = model("openhole.json");
    let mut arguments: Vec<&str> = arguments[..end].to_vec();
    arguments.insert(1, &file);
    arguments.extend(["--out", out.to_str().unwrap()]);
    succeed(&arguments);
    for name in ["X.txt", "Y.txt", "U.txt", "V.txt"] {
        let [made, kept] = [out.join(name), root().join("models/openhole").join(name)]
            .map(|p| std::fs::read_to_string(p).unwrap());
        let numbers = |t: &str| {
            t.split_whitespace()
                .map(|v| v.parse::<f64>().unwrap())
                .collect::<Vec<_>>()
        };
        let (made, kept) = (numbers(&made), numbers(&kept));
        assert_eq!(made.len(), kept.len());
        // Another machine's mathematical library may round the last digit the other way.
        let close = made
            .iter()
            .zip(&kept)
            .all(|(a, b)| (a.is_nan() && b.is_nan()) || (a - b).abs() < 2e-5);
        assert!(close, "{name} differs from the command's");
    }
}
