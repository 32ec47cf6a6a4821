//! Inputs of which no reduced model can be made end in an error that says what to change.

use std::path::Path;

use plychain::error::Error;
use plychain::infer::{Model, drawn_in, problem_within};
use plychain::reduce::{Choice, Modes, ReducedSpec, SnapshotsSpec, Surface, Variables};

use super::{points, small_problem};

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
    problem.spec.snapshots = SnapshotsSpec::Count(50);
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

/// The default model with these priors, and nothing else of its box.
fn with_priors(change: impl Fn(&mut serde_json::Value)) -> Model {
    let file = crate::common::changed("openhole.json", |m| {
        let priors = [
            ("E1_GPa", 15.0, 5.0),
            ("E2_GPa", 10.0, 6.0),
            ("nu12", 0.2, 0.1),
            ("G12_GPa", 2.5, 1.5),
        ];
        for (name, mean, sd) in priors {
            m["material"]["parameters"][name]["prior"]["normal"] =
                serde_json::json!({"mean": mean, "sd": sd});
        }
        m["reduced_model"]
            .as_object_mut()
            .unwrap()
            .remove("reference");
        change(m);
    });
    Model::load(Path::new(&file)).unwrap()
}

/// Priors so wide that no ply can be in a corner of their box: what has a part in it is drawn in about the means, and said.
#[test]
fn a_box_is_drawn_in_to_what_a_ply_can_be() {
    let model = with_priors(|_| {});
    let said = drawn_in(&model).unwrap();
    let problem = problem_within(&model, [[-8.0; 2], [8.0; 2]], None).unwrap();
    let [e1, e2, nu, g] = [0, 1, 2, 3].map(|k| problem.dimensions[k].clone());
    // the priors' +- 3 sd, a quarter of the mean at least
    assert_eq!(
        [e1.high, e2.low, nu.low, g.low, g.high],
        [30.0, 2.5, 0.2 - 0.1 * 3.0, 0.625, 7.0]
    );
    let share = [
        (15.0 - e1.low) / (15.0 - 3.75),
        (e2.high - 10.0) / 18.0,
        (nu.high - 0.2) / (3.0 * 0.1),
    ];
    assert!(
        share
            .iter()
            .all(|s| (s - share[0]).abs() < 1e-9 && *s > 0.5 && *s < 1.0),
        "{share:?}"
    );
    let limit = nu.high * nu.high * e2.high / e1.low;
    assert!((limit - 0.8).abs() < 1e-6, "{limit}");
    for word in ["E1_GPa from [3.7500, 30.0000]", "E2_GPa", "nu12"] {
        assert!(said.contains(word), "{said}");
    }
    assert!(!said.contains("G12"), "{said}");
    // what is declared stays: the others give way, or none do and the box is refused
    let declared = with_priors(|m| {
        m["reduced_model"]["doe"] = serde_json::json!({"E1_GPa": [5.0, 25.0]});
    });
    let problem = problem_within(&declared, [[-8.0; 2], [8.0; 2]], None).unwrap();
    assert_eq!(
        [problem.dimensions[0].low, problem.dimensions[0].high],
        [5.0, 25.0]
    );
    assert!(!drawn_in(&declared).unwrap().contains("E1_GPa"));
    let hopeless = with_priors(|m| {
        m["reduced_model"]["doe"] = serde_json::json!({"E1_GPa": [0.3, 25.0]});
    });
    let error = problem_within(&hopeless, [[-8.0; 2], [8.0; 2]], None)
        .err()
        .unwrap();
    assert!(told(&error).contains("corner of the DoE box"));
    let usual = Model::load(Path::new(&crate::common::model("openhole.json"))).unwrap();
    assert!(drawn_in(&usual).is_none());
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
