//! Inputs of a campaign that have changed, fail or are refused.

use super::*;

#[test]
fn changed_inputs_are_noticed() {
    let bench = Bench::new(3);
    bench.coupons(2000);
    bench.succeed(&["campaign", "campaign.json", "--out", "runs"]);
    let resumed = ["campaign", "campaign.json", "--out", "runs", "--resume"];
    let file = bench.place.join("coupon-2/U.txt");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, format!("{text}\n")).unwrap();
    let said = bench.refused(&resumed, 1);
    assert!(
        said.contains("mock-coupon-2") && said.contains("U.txt"),
        "{said}"
    );
    bench.succeed(&[&resumed[..], &["--rerun-changed"]].concat());
    assert!(all_done(&bench.manifest("runs")));
    let kept = std::fs::read_dir(bench.place.join("runs/replaced")).unwrap();
    let kept: Vec<_> = kept.map(|e| e.unwrap().file_name()).collect();
    assert_eq!(kept, ["mock-coupon-2-1"]);
    // other options are another run
    bench.coupons(3000);
    let said = bench.refused(&resumed, 1);
    assert!(said.contains("mock-coupon-1"), "{said}");
    let said = bench.refused(&["campaign", "campaign.json", "--out", "runs"], 1);
    assert!(said.contains("--resume"), "{said}");
    let said = bench.refused(&["campaign", "campaign.json", "--out", "coupon-1"], 1);
    assert!(said.contains("nothing was changed"), "{said}");
}

/// A run that fails does not stop the others, and its cause is in the manifest.
#[test]
fn a_run_that_fails_says_why() {
    let bench = Bench::new(3);
    bench.coupons(2000);
    let file = bench.place.join("coupon-2/U.txt");
    let kept = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, "no numbers").unwrap();
    let said = bench.refused(&["campaign", "campaign.json", "--out", "runs"], 1);
    assert!(said.contains("1 of 3 that failed"), "{said}");
    let manifest = bench.manifest("runs");
    assert_eq!(
        manifest["counts"],
        json!({ "waiting": 0, "running": 0, "done": 2, "failed": 1, "to_be_resumed": 0 })
    );
    let cause = manifest["runs"][1]["cause"].as_str().unwrap();
    assert!(cause.contains("U.txt"), "{cause}");
    // it failed for good, and is not tried again unless that is asked for
    bench.refused(
        &["campaign", "campaign.json", "--out", "runs", "--resume"],
        1,
    );
    assert_eq!(bench.attempts("runs")["mock-coupon-2"], 1);
    std::fs::write(&file, kept).unwrap();
    let again = [
        "campaign",
        "campaign.json",
        "--out",
        "runs",
        "--resume",
        "--retry",
    ];
    bench.succeed(&[&again[..], &["--rerun-changed"]].concat());
    assert!(all_done(&bench.manifest("runs")));
}

/// A run that wants more memory than it may have fails, and says so.
#[test]
#[cfg(target_os = "linux")]
fn memory_is_limited() {
    let bench = Bench::new(1);
    bench.coupons(2000);
    let limited = ["campaign", "campaign.json", "--out", "small", "--memory-gb"];
    bench.refused(&[&limited[..], &["0.12"]].concat(), 1);
    let run = &bench.manifest("small")["runs"][0];
    assert_eq!(run["state"], "failed");
    assert!(run["cause"].as_str().unwrap().contains("memory"), "{run}");
    bench.succeed(&[&limited[..], &["16", "--resume", "--retry"]].concat());
}

#[test]
fn broken_campaign_files_are_refused() {
    let bench = Bench::new(1);
    let good = json!({ "schema": "plychain-campaign/1", "name": "x", "verb": "identify", "models": "mock.json" });
    let broken: [(&str, Value, &str); 14] = [
        (
            "schema",
            "plychain-campaign/9".into(),
            "plychain-campaign/1",
        ),
        ("model", "mock.json".into(), "model"),
        ("verb", "guess".into(), "verb"),
        ("name", "a/b".into(), "name"),
        ("models", "none-*.json".into(), "none-*.json"),
        ("models", "none.json".into(), "none.json"),
        ("models", json!([1]), "pattern"),
        ("seeds", json!({ "from": 1 }), "seeds"),
        ("seeds", json!([-1]), "seeds"),
        ("sweep", json!({ "no.such.key": [1] }), "no.such.key"),
        ("sweep", json!({ "material.kinds": [1] }), "kinds"),
        ("options", json!({ "rounds": 2 }), "rounds"),
        ("options", json!({ "sampler": "guess" }), "sampler"),
        (
            "runs",
            json!([{ "name": "a", "model": "mock.json" }, { "name": "a", "model": "mock.json" }]),
            "differ",
        ),
    ];
    for (key, value, named) in broken {
        let mut file = good.clone();
        file[key] = value;
        bench.write("broken.json", &file);
        let said = bench.refused(&["campaign", "broken.json", "--out", "broken"], 1);
        assert!(
            said.contains(named) && said.contains("expected"),
            "{key}: {said}"
        );
        assert!(!bench.place.join("broken").exists(), "{key}");
    }
    bench.refused(&["campaign"], 1);
    bench.refused(&["campaign", "mock.json", "--engine", "cloud"], 1);
    bench.refused(&["campaign", "collect", "coupon-1"], 1);
}

/// The table of a campaign's help and the engines are the same.
#[test]
fn every_engine_is_in_the_help() {
    let help = succeed(&["campaign", "--help"]);
    for engine in plychain::campaign::ENGINES {
        assert!(help.contains(engine.name()), "{}", engine.name());
    }
}
