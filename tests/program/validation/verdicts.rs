//! Verdicts over simulated measurements: what is counted, and that a record is gone on with.

use plychain::validate::calibration::ReplicatePlan;
use plychain::validate::verdicts::{
    ActedEffect, HowOften, VerdictPlan, VerdictReplicate, VerdictSummary,
};

use super::*;

fn replicate(
    acted: &[(&str, bool)],
    named: &[&[&str]],
    status: &str,
    bias: [f64; 2],
) -> VerdictReplicate {
    let text = |name: &&str| (*name).to_string();
    VerdictReplicate {
        replicate: 0,
        acted: acted
            .iter()
            .map(|(name, shows)| ActedEffect {
                effect: text(name),
                law: None,
                shows: *shows,
            })
            .collect(),
        named: named
            .iter()
            .map(|group| group.iter().map(text).collect())
            .collect(),
        status: status.into(),
        held: vec![true, true, false, true],
        bias,
    }
}

#[test]
fn names_are_counted_by_hand() {
    let plan = ReplicatePlan {
        replicates: 7,
        correlation_mm: 0.0,
        seed: 1,
        grid: 41,
        share: None,
    };
    let asked = VerdictPlan {
        effects: 2,
        whole: false,
    };
    let all = [
        // two nulls, one with a false name
        replicate(&[], &[], "nothing missing", [0.0; 2]),
        replicate(&[], &[&["camera_tilt"]], "closed", [0.0; 2]),
        // both named
        replicate(
            &[("a", true), ("b", true)],
            &[&["a"], &["b"]],
            "closed",
            [10.0, 0.1],
        ),
        // one by its look-alike
        replicate(&[("a", true)], &[&["c", "a"]], "closed", [2.0, 1.0]),
        // one too small to be shown, the other not found
        replicate(&[("a", false), ("b", true)], &[], "unexplained", [1.0, 1.0]),
        // another effect beside the right one
        replicate(&[("b", true)], &[&["b"], &["c"]], "closed", [4.0, 1.0]),
        // named, and too small to move the constants by an sd
        replicate(&[("a", true)], &[&["a"]], "closed", [0.5, 0.4]),
    ];
    let summary = VerdictSummary::new(&plan, asked, &all);
    let counts = [
        summary.named_in_nulls,
        summary.unexplained_nulls,
        summary.exact,
        summary.recalled,
        summary.recalled_of_shown,
        summary.recalled_alone,
        summary.right_groups,
        summary.right_alone,
        summary.sure_and_wrong,
        summary.held,
    ];
    let expected = [
        [1, 2],
        [0, 2],
        [3, 5],
        [5, 7],
        [5, 6],
        [4, 7],
        [5, 7],
        [4, 6],
        [2, 7],
        [21, 28],
    ];
    assert_eq!(counts.map(|c| [c.found, c.of]), expected);
    let [named, alone] = summary.f1();
    assert!((named - 5.0 / 7.0).abs() < 1e-12);
    assert!((alone - 8.0 / 13.0).abs() < 1e-12);
    // of 0.01, 0.5 and 0.25
    assert_eq!(summary.biased, 3);
    assert!((summary.bias_left - 0.25).abs() < 1e-12);
    // Wilson's interval of 5 of 100 (Newcombe 1998, Stat. Med. 17, 857)
    let [low, high] = HowOften { found: 5, of: 100 }.interval();
    assert!(
        (low - 0.0215).abs() < 1e-4 && (high - 0.1118).abs() < 1e-4,
        "{low} {high}"
    );
}

/// Of two loud effects that are nothing alike none is confused with the other, and a record that a kill cut off ends with the same bits.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_small_table_of_verdicts_is_resumable() {
    let folder = fresh("verdicts");
    let file = changed("openhole.json", |m| {
        set_coarse(m);
        m["experiments"][0]["candidates"] = serde_json::json!(["load_misalignment", "camera_tilt"]);
    });
    let out = folder.display().to_string();
    let run = |n: &str| {
        let arguments = [
            "validate",
            &file,
            "--verdicts",
            n,
            "--effects",
            "2",
            "--quiet",
        ];
        succeed(
            &[
                &arguments[..],
                &["--grid", "41", "--correlation-mm", "0", "--out", &out],
            ]
            .concat(),
        )
    };
    let said = run("6");
    assert!(
        said.contains("verdicts on 6 simulated measurements"),
        "{said}"
    );
    let path = folder.join("verdicts-0mm.jsonl");
    let whole = std::fs::read_to_string(&path).unwrap();
    let last = whole.lines().last().unwrap().len();
    std::fs::write(&path, &whole[..whole.len() - last / 2]).unwrap();
    run("6");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
    let text = std::fs::read_to_string(folder.join("validation.json")).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    let found = &found["verdicts"][0];
    assert_eq!(found["replicates"], 6);
    assert_eq!(found["sure_and_wrong"]["found"], 0, "{found}");
    let acted = whole.lines().skip(1).map(|l| {
        let line: Value = serde_json::from_str(l).unwrap();
        line["acted"].as_array().unwrap().len()
    });
    let acted: Vec<usize> = acted.collect();
    assert!(
        acted.contains(&0) && acted.iter().any(|n| *n > 0),
        "{acted:?}"
    );
}
