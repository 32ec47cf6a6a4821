//! What every verb prints is in short sentences.

use std::process::Output;

use serde_json::json;

use crate::common::{coarse, fresh, model, plychain, plychain_in};
use crate::prose::{is_short, paragraphs_of_terminal};

/// That what a verb printed is in short sentences: results, and remarks.
fn judge(arguments: &[&str], end: &Output) {
    let text = [&end.stdout, &end.stderr].map(|t| String::from_utf8_lossy(t).into_owned());
    assert!(
        end.status.success(),
        "{arguments:?}\n{}\n{}",
        text[0],
        text[1]
    );
    for text in text {
        is_short(&format!("{arguments:?}"), &paragraphs_of_terminal(&text));
    }
}

/// Every verb but those that need a server (`sample`, `serve`), once as it stands in a shell, and once in full.
#[test]
#[ignore = "slow: run by .ci/run"]
fn every_verb_speaks_in_short_sentences() {
    let plain = |arguments: &[&str]| judge(arguments, &plychain(arguments));
    let path = |name: &str| fresh(name).display().to_string();
    let (own, run) = (coarse(), path("spoken"));
    plain(&["loop", &own, "--out", &run]);
    plain(&["loop", &own, "--out", &path("spoken-v"), "-v"]);
    let plate = model("plate.json");
    plain(&["identify", &plate, "--out", &path("plate"), "-v"]);
    let both = model("openhole-and-plate.json");
    plain(&["identify", &both, "--out", &path("both"), "-v"]);
    for verb in ["trace", "report", "diagnose", "validate"] {
        plain(&[verb, &run]);
    }
    plain(&["report", &run, &run]);
    plain(&["diagnose", &run, "--all"]);
    plain(&["export", &run, "--format", "npz", "--out", &path("copies")]);
    plain(&["build", &own]);
    plain(&["design", &own]);
    let calculix = model("openhole-calculix.json");
    let rows = path("doe.csv");
    plain(&["design-of-experiments", &calculix, "--out", &rows]);
    plain(&["effects"]);
    plain(&["effects", &own]);
    let (images, shifter) = (path("images"), "step_error=0.05,initial_fringes=12");
    plain(&["simulate", "--fringes", shifter, "--out", &images]);
    let fringes = format!("{images}/fringes.json");
    plain(&["fringes", &fringes, "--out", &path("field")]);
    let out = path("calibrated");
    plain(&["validate", &own, "--calibrate", "1", "--out", &out]);
}

/// The verbs of several specimens, and of one that was never seen.
#[test]
#[ignore = "slow: run by .ci/run"]
fn campaigns_and_init_speak_in_short_sentences() {
    let folder = tempfile::tempdir().unwrap();
    let plain = |arguments: &[&str]| judge(arguments, &plychain_in(folder.path(), arguments));
    let own = coarse();
    for seed in ["1", "2", "3"] {
        let out = format!("coupon-{seed}");
        let mut arguments = vec!["simulate", &own, "--format", "csv", "--grid", "61"];
        arguments.extend(["--seed", seed, "--out", &out]);
        plain(&arguments);
    }
    plain(&["init", "specimen", "--csv", "coupon-1/field.csv"]);
    let campaign = json!({ "schema": "plychain-campaign/1", "name": "coupons", "verb": "identify",
        "models": "coupon-*/model.json" });
    std::fs::write(folder.path().join("coupons.json"), campaign.to_string()).unwrap();
    plain(&["campaign", "coupons.json"]);
    for verb in ["status", "collect", "population"] {
        plain(&["campaign", verb, "runs/coupons"]);
    }
}
