//! Campaigns: every run done once, whatever ends in between, and the same bits by every engine.

mod answers;
mod cluster;
mod refused;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use crate::common::{fresh, program, root, succeed};

/// A folder with measurements of a sheet in closed form, whose model is `mock.json`.
struct Bench {
    place: PathBuf,
}

impl Bench {
    fn new(coupons: usize) -> Self {
        let place = fresh("campaign");
        std::fs::create_dir(&place).unwrap();
        let text = std::fs::read_to_string(root().join("models/openhole.json")).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        model["name"] = "mock".into();
        model["experiments"][0]["kind"] = "mock".into();
        model["experiments"][0]["measurement"]["dir"] = "coupon-1".into();
        model["reduced_model"] = json!({ "snapshots": 60, "modes": 4, "degree": 3 });
        std::fs::write(place.join("mock.json"), model.to_string()).unwrap();
        let bench = Self { place };
        for k in 1..=coupons {
            let (e1, seed) = (format!("E1_GPa={}", 150 + k % 4), k.to_string());
            let out = format!("coupon-{k}");
            let arguments = ["simulate", "mock.json", "--grid", "15", "--set", &e1];
            let end = bench.run(&[&arguments[..], &["--seed", &seed, "--out", &out]].concat());
            assert!(end.status.success(), "{end:?}");
        }
        bench
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = program();
        command
            .current_dir(&self.place)
            .arg("--quiet")
            .args(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn succeed(&self, arguments: &[&str]) -> String {
        let end = self.run(arguments);
        assert!(end.status.success(), "{arguments:?} {end:?}");
        String::from_utf8(end.stdout).unwrap()
    }

    /// What is said of a command that is refused.
    fn refused(&self, arguments: &[&str], code: i32) -> String {
        let end = self.run(arguments);
        assert_eq!(end.status.code(), Some(code), "{arguments:?} {end:?}");
        String::from_utf8(end.stderr).unwrap()
    }

    fn write(&self, name: &str, file: &Value) {
        std::fs::write(self.place.join(name), file.to_string()).unwrap();
    }

    /// Identifications of all coupons, of so many draws.
    fn coupons(&self, draws: usize) {
        self.write(
            "campaign.json",
            &json!({ "schema": "plychain-campaign/1", "name": "coupons", "verb": "identify", "models": "mock.json",
                "data": "coupon-*", "options": { "max_draws": draws, "min_ess": 1e9 } }),
        );
    }

    fn manifest(&self, folder: &str) -> Value {
        read_json(&self.place.join(folder).join("manifest.json"))
    }

    fn attempts(&self, folder: &str) -> BTreeMap<String, u64> {
        let manifest = self.manifest(folder);
        let runs = manifest["runs"].as_array().unwrap();
        let attempts = |r: &Value| {
            let name = r["name"].as_str().unwrap().to_string();
            (name, r["attempts"].as_u64().unwrap())
        };
        runs.iter().map(attempts).collect()
    }
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn all_done(manifest: &Value) -> bool {
    let runs = manifest["runs"].as_array().unwrap();
    runs.iter().all(|r| r["state"] == "done")
}

/// The digests of all draws in a folder's store.
fn chain(folder: &Path) -> Value {
    read_json(&folder.join("chain.zarr/zarr.json"))["attributes"]["digests"].clone()
}

/// Those of every run.
fn chains(folder: &Path) -> BTreeMap<String, Value> {
    let entries = std::fs::read_dir(folder.join("runs")).unwrap();
    let own = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, chain(&path))
    };
    entries.map(|e| own(e.unwrap().path())).collect()
}

fn wait(what: &str, mut is: impl FnMut() -> bool) {
    for _ in 0..600 {
        if is() {
            return;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("{what} within a minute");
}

fn tell_to_stop(child: &Child) {
    let id = child.id().to_string();
    let told = Command::new("kill").args(["-TERM", &id]).status();
    assert!(told.unwrap().success());
}

/// A campaign's runs are what the same commands leave behind, in whatever share they are run.
#[test]
fn runs_of_a_campaign_are_ordinary_runs() {
    let bench = Bench::new(3);
    bench.coupons(4000);
    bench.succeed(&["campaign", "campaign.json", "--out", "whole"]);
    assert!(all_done(&bench.manifest("whole")));
    for k in 1..=2 {
        let task = k.to_string();
        let end = bench.run(&[
            "campaign",
            "campaign.json",
            "--out",
            "shares",
            "--task",
            &task,
            "--of",
            "2",
        ]);
        assert!(end.status.success(), "{end:?}");
        assert_eq!(all_done(&bench.manifest("shares")), k == 2);
    }
    let whole = chains(&bench.place.join("whole"));
    assert_eq!(whole.len(), 3);
    assert!(whole == chains(&bench.place.join("shares")));
    for k in 1..=3 {
        let (data, out) = (format!("coupon-{k}"), format!("alone-{k}"));
        let limits = ["--max-draws", "4000", "--min-ess", "1e9"];
        let arguments = ["identify", "mock.json", "--data", &data, "--out", &out];
        bench.succeed(&[&arguments[..], &limits].concat());
        let alone = chain(&bench.place.join(&out));
        assert!(alone.is_object() && whole[&format!("mock-coupon-{k}")] == alone);
    }
    let table = bench.succeed(&["campaign", "collect", "whole"]);
    assert!(table.contains("3 done"), "{table}");
    let csv = std::fs::read_to_string(bench.place.join("whole/collected.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let header = reader.headers().unwrap().clone();
    let mean = header.iter().position(|h| h == "E1_GPa_mean").unwrap();
    let means: Vec<f64> = reader
        .records()
        .map(|r| r.unwrap()[mean].parse().unwrap())
        .collect();
    for (k, mean) in means.iter().enumerate() {
        assert!((mean - 151.0 - k as f64).abs() < 6.0, "{means:?}");
    }
    let html = std::fs::read_to_string(bench.place.join("whole/collected.html")).unwrap();
    assert!(html.contains("mock-coupon-3") && html.contains("G12_GPa"));
}

/// Models x points of a sweep x seeds, and runs that are listed; the values stand in the models that are run.
#[test]
fn a_campaign_is_written_out_in_order() {
    let bench = Bench::new(1);
    let thickness = "experiments.0.specimen.thickness_mm.sd";
    bench.write(
        "sweep.json",
        &json!({ "schema": "plychain-campaign/1", "name": "sweep", "verb": "identify", "models": ["mock.json"],
            "seeds": { "from": 5, "count": 2 }, "sweep": { thickness: [0.005, 0.01] }, "options": { "max_draws": 2000 },
            "runs": [{ "name": "plain", "model": "mock.json", "data": "coupon-1", "seed": 9, "options": { "sampler": "adaptive", "max_draws": 1000 } }] }),
    );
    let script = bench.succeed(&["campaign", "sweep.json", "--out", "swept", "--dry-run"]);
    let names = [
        "point-1-seed-5",
        "point-1-seed-6",
        "point-2-seed-5",
        "point-2-seed-6",
    ];
    let names: Vec<String> = names.iter().map(|n| format!("mock-{n}")).collect();
    let lines: Vec<&str> = script.lines().collect();
    assert_eq!(lines.len(), 5, "{script}");
    for (line, name) in lines.iter().zip(&names) {
        assert!(line.contains(&format!("swept/runs/{name} ")), "{line}");
    }
    assert!(
        lines[4].contains("--data") && lines[4].contains("--seed 9"),
        "{script}"
    );
    assert!(lines[4].contains("--sampler adaptive"), "{script}");
    assert!(!bench.place.join("swept/runs/plain").exists());
    bench.succeed(&["campaign", "sweep.json", "--out", "swept", "--resume"]);
    for (name, sd) in names.iter().zip([0.005, 0.005, 0.01, 0.01]) {
        let model = read_json(&bench.place.join(format!("swept/runs/{name}/model.json")));
        assert_eq!(
            model["experiments"][0]["specimen"]["thickness_mm"]["sd"],
            sd
        );
    }
    let chains = chains(&bench.place.join("swept"));
    assert!(chains[&names[0]] != chains[&names[1]], "seeds differ");
}

/// Killed at any moment, and gone on with: what was done is not done again, and the chains are those of a campaign that was not killed.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_killed_campaign_repeats_nothing() {
    let bench = Bench::new(6);
    bench.coupons(400_000);
    bench.succeed(&["campaign", "campaign.json", "--out", "whole"]);
    let start = |out: &str| {
        let resumed = [
            "campaign",
            "campaign.json",
            "--out",
            out,
            "--resume",
            "--jobs",
            "2",
        ];
        bench.command(&resumed).spawn().unwrap()
    };
    let done = || {
        let runs = std::fs::read_dir(bench.place.join("killed/runs"));
        let runs = runs.into_iter().flatten().flatten();
        runs.filter(|e| e.path().join("report.html").exists())
            .count()
    };
    for most in [1, 3] {
        let mut child = start("killed");
        wait("some runs are done", || done() >= most);
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let before = done();
    assert!(before < 6, "all done before it was gone on with");
    let end = start("killed").wait_with_output().unwrap();
    assert!(end.status.success(), "{end:?}");
    assert!(all_done(&bench.manifest("killed")));
    assert!(chains(&bench.place.join("whole")) == chains(&bench.place.join("killed")));
    let attempts: u64 = bench.attempts("killed").values().sum();
    // two kills, each of two runs at most that were being run
    assert!(attempts <= 6 + 4, "{attempts} attempts");
    let once_more = bench.attempts("killed");
    bench.succeed(&["campaign", "campaign.json", "--out", "killed", "--resume"]);
    assert_eq!(bench.attempts("killed"), once_more);
}

/// SIGTERM reaches the runs, which flush and can be gone on with; exit status 75 says so.
#[test]
#[ignore = "slow: run by .ci/run"]
#[cfg(unix)]
fn a_campaign_that_is_told_to_stop_is_gone_on_with() {
    let bench = Bench::new(2);
    bench.coupons(3_000_000);
    let command = [
        "campaign",
        "campaign.json",
        "--out",
        "told",
        "--resume",
        "--jobs",
        "2",
    ];
    let child = bench.command(&command).spawn().unwrap();
    let begun = |k: usize| {
        bench
            .place
            .join(format!("told/runs/mock-coupon-{k}/checkpoint"))
    };
    wait("both runs have begun", || {
        begun(1).exists() && begun(2).exists()
    });
    tell_to_stop(&child);
    let end = child.wait_with_output().unwrap();
    assert_eq!(end.status.code(), Some(75), "{end:?}");
    let manifest = bench.manifest("told");
    for run in manifest["runs"].as_array().unwrap() {
        assert_eq!(run["state"], "to_be_resumed", "{run}");
        assert_eq!(run["cause"], "told to stop", "{run}");
    }
    bench.succeed(&command);
    assert!(all_done(&bench.manifest("told")));
    bench.succeed(&["campaign", "campaign.json", "--out", "whole"]);
    assert!(chains(&bench.place.join("whole")) == chains(&bench.place.join("told")));
}

/// A run alone that is told to stop keeps its folder.
#[test]
#[ignore = "slow: run by .ci/run"]
#[cfg(unix)]
fn a_run_that_is_told_to_stop_is_gone_on_with() {
    let bench = Bench::new(1);
    let draws = ["--max-draws", "3000000", "--min-ess", "1e9"];
    let command = |out| [&["identify", "mock.json", "--out", out], &draws[..]].concat();
    let child = bench.command(&command("told")).spawn().unwrap();
    wait("it has begun", || {
        bench.place.join("told/checkpoint").exists()
    });
    tell_to_stop(&child);
    let end = child.wait_with_output().unwrap();
    assert_eq!(end.status.code(), Some(75), "{end:?}");
    let said = String::from_utf8(end.stderr).unwrap();
    assert!(
        said.contains("SIGTERM") && said.contains("--resume"),
        "{said}"
    );
    bench.succeed(&[&command("told")[..], &["--resume"]].concat());
    bench.succeed(&command("whole"));
    let draws = |name: &str| chain(&bench.place.join(name));
    assert!(draws("told").is_object() && draws("told") == draws("whole"));
}

/// The material of a campaign's specimens: its files are chains like any other, the same for any number of threads; one measurement is one
/// specimen, and what is left out is said.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_population_is_made_of_the_specimens_of_a_campaign() {
    let bench = Bench::new(5);
    bench.coupons(4000);
    bench.succeed(&["campaign", "campaign.json", "--out", "whole"]);
    let manifest = bench.manifest("whole");
    let last = manifest["runs"][4]["name"].as_str().unwrap();
    let of_four = ["campaign", "population", "whole", "--leave-out", last];
    let said = bench.succeed(&[&of_four[..], &["--threads", "1"]].concat());
    assert!(said.contains("population of 4 specimens"), "{said}");
    let left_out = format!("not among the specimens: {last}");
    assert!(said.contains(&left_out), "{said}");
    let draws = || chain(&bench.place.join("whole/population"));
    let first = draws();
    assert!(first.is_object());
    bench.succeed(&[&of_four[..], &["--threads", "2"]].concat());
    assert_eq!(first, draws());
    let report = read_json(&bench.place.join("whole/population/population.json"));
    assert_eq!(report["schema"], "plychain-population/1");
    // E1 is 151, 152, 153, 150 GPa in turn, each measured to about a percent
    let e1 = &report["constants"]["E1_GPa"];
    let at = |path: &str| e1.pointer(path).unwrap().as_f64().unwrap();
    assert!(
        (at("/mean/mean") - 151.5).abs() < 4.0 * at("/mean/sd"),
        "{e1}"
    );
    assert!(at("/a_basis/value") < at("/b_basis/value"), "{e1}");
    assert!(at("/b_basis/value") < at("/mean/low"), "{e1}");
    let judged = bench.succeed(&["diagnose", "whole/population"]);
    assert!(judged.contains("percentile_10_E1_GPa"), "{judged}");

    let said = bench.refused(
        &["campaign", "population", "whole", "--leave-out", "coupon-9"],
        1,
    );
    assert!(said.contains("a run of the campaign"), "{said}");
    bench.write(
        "twice.json",
        &json!({ "schema": "plychain-campaign/1", "name": "twice", "verb": "identify", "models": "mock.json", "data": "coupon-1",
            "seeds": [1, 2, 3], "options": { "max_draws": 2000, "min_ess": 1e9 } }),
    );
    bench.succeed(&["campaign", "twice.json", "--out", "twice"]);
    let said = bench.refused(&["campaign", "population", "twice"], 1);
    assert!(said.contains("one run a specimen"), "{said}");
}
