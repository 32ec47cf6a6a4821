//! The published schema of report.json is a type: what it reads it writes again, and what it cannot read it names.

use std::path::Path;

use plychain::files::parse_json;
use plychain::infer::Model;
use plychain::report::Report;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::common::read;
use crate::common::succeed;
use crate::report::{changed, looped, run};

/// Windows' editors begin a file with a byte order mark, or write UTF-16.
#[test]
fn a_model_file_is_read_in_the_encodings_of_editors() {
    let text = read(Path::new("models/openhole.json"));
    let units = std::iter::once(0xfeff).chain(text.encode_utf16());
    let utf16: Vec<u8> = units.flat_map(u16::to_le_bytes).collect();
    let place = tempfile::tempdir().unwrap();
    for bytes in [format!("\u{feff}{text}").into_bytes(), utf16] {
        let file = place.path().join("model.json");
        std::fs::write(&file, bytes).unwrap();
        assert_eq!(Model::text(&file).unwrap(), text);
    }
}

/// Every key of a report comes back from its type as it was, in order: that of one identification, and that of a loop.
#[test]
fn a_report_goes_through_its_type_unchanged() {
    let whole = |folder: &Path| {
        let written = read(&folder.join("report.json"));
        let again = serde_json::to_string(&Report::load(folder).unwrap()).unwrap();
        (
            serde_json::from_str::<Value>(&written).unwrap().to_string(),
            again,
        )
    };
    let (written, again) = whole(run());
    assert_eq!(written, again);
    let looped = changed(|report| {
        looped(report);
        // keys that may be left out are written with what they mean
        for round in report["rounds"].as_array_mut().unwrap() {
            for key in ["candidates", "accepted"] {
                round.as_object_mut().unwrap().shift_remove(key);
            }
            round["candidates"] = json!([{
                "effect": "magnification", "inclusion_probability": 0.02, "log_bayes_factor": null,
                "amplitude": [{ "parameter": "percent", "mean": 0.1, "sd": 0.2 }], "plausible_multiple": null,
                "implausible": false, "explained_fraction": 0.29, "detectable": null,
                "aliases": [{ "effect": "hole_size", "cosine": 0.5 }],
            }]);
            round["groups"] = json!([{
                "leader": "a", "members": ["a", "b"], "pairs": [["c", "d"]], "resembling": [{
                    "effect": "e", "cosine": 0.9, "amplitude": [{ "parameter": "x_mm", "value": 1.5 }],
                    "plausible_multiple": 1.0, "log_evidence_lost": null,
                }],
                "probability": 1.0, "log_evidence_lost_without": 3.5, "predicts_held_out_blocks": true,
            }]);
            round["accepted"] = json!(["a"]);
            round["undecided"] = json!([["a", "b"]]);
            round["discrepancy_probability"] = json!(0.25);
            round["averaged_posterior"] = json!({});
            round["left_out"] = json!([{ "effect": "load_scale", "reason": "a factor" }]);
        }
        for spot in report["blind_spots"].as_array_mut().unwrap() {
            let mut whole = json!({});
            for key in [
                "effect",
                "parameter",
                "plausible",
                "unit",
                "shift_in_percent",
                "beyond_linear",
                "detectable",
                "would_be_seen",
            ] {
                whole[key] = if key == "beyond_linear" {
                    json!(["nu12"])
                } else {
                    spot[key].clone()
                };
            }
            *spot = whole;
        }
        let parts = report.as_object_mut().unwrap();
        for key in [
            "averaged_posterior",
            "quoted",
            "averaged_note",
            "blind_spots",
            "before_after",
            "verdict",
        ] {
            let part = parts.shift_remove(key).unwrap_or(Value::Null);
            parts.insert(key.into(), part);
        }
        let verdict = report["verdict"].clone();
        report["verdict"] = json!({
            "status": verdict["status"], "effects": ["load_misalignment"], "alias_groups": [["a", "b"]],
            "alias_sizes": [], "vetoes": ["the misfit is larger than noise makes it"],
            "undecided": [], "text": verdict["text"], "confirm": verdict["confirm"],
        });
    });
    let (written, again) = whole(&looped);
    assert_eq!(written, again);
}

/// A report that cannot be read is refused with its file and the key; keys that were added later may be absent.
#[test]
fn a_mangled_report_is_refused_with_its_key() {
    type Change = fn(&mut Value);
    let refused: [(Change, &[&str]); 5] = [
        (
            |r| r["schema"] = json!("plychain-report/2"),
            &["plychain-report/1"],
        ),
        (
            |r| r["rounds"][0]["posterior"]["nu12"]["mean"] = json!("much"),
            &["rounds[0].posterior.nu12.mean"],
        ),
        (
            |r| r["rounds"][0]["residual"]["rms_nm"] = json!({ "u1": 1.0 }),
            &["rounds[0].residual.rms_nm", "u2"],
        ),
        (
            |r| {
                looped(r);
                r["verdict"]["status"] = json!("open");
            },
            &["verdict.status", "open"],
        ),
        (
            |r| {
                looped(r);
                r["rounds"][0]["candidates"][0]["aliases"] = json!([{ "effect": 3 }]);
            },
            &["candidates[0].aliases[0].effect"],
        ),
    ];
    for (change, words) in refused {
        let folder = changed(change);
        let error = Report::load(&folder).unwrap_err().to_string();
        for word in words.iter().chain(&["report.json"]) {
            assert!(error.contains(word), "{word} is missing in {error}");
        }
    }
    let older = changed(|r| {
        let round = r["rounds"][0].as_object_mut().unwrap();
        round["residual"]
            .as_object_mut()
            .unwrap()
            .remove("patterns");
        round.remove("full_model");
        r["added_later"] = json!([1, 2]);
    });
    succeed(&["report", &older.display().to_string()]);
}

/// The key of a wrong value is named wherever it stands: at the end of its object, in a list, in an object of several kinds.
#[test]
fn a_wrong_value_is_named_with_its_keys() {
    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind", rename_all = "lowercase")]
    #[allow(dead_code)]
    enum Shape {
        Circle { radius_mm: f64 },
    }
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Sheet {
        name: Option<String>,
        holes: Vec<Shape>,
        sides: Option<[f64; 2]>,
    }
    let cases = [
        (
            r#"{"holes": [{"kind": "circle", "radius_mm": "wide"}]}"#,
            "a.json:1:51: holes[0]: ",
        ),
        (
            "{\"name\": \"}, {\",\n\"holes\": [], \"sides\": [1, \"two\"]}",
            "a.json:2:31: sides[1]: ",
        ),
        (r#"{"holes": [], "colour": 1}"#, "a.json:1:22: colour: "),
        (
            r#"{"holes": [{"kind": "circle", "radius_mm": 1}], "sides": [1, }"#,
            "sides[1]: ",
        ),
        (r#"{"name": "a"}"#, "missing field `holes`"),
    ];
    for (text, words) in cases {
        let error = parse_json::<Sheet>(text, "a.json").unwrap_err().to_string();
        assert!(error.contains(words), "{words} is missing in {error}");
    }
}
