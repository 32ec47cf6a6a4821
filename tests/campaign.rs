//! Campaigns: every run done once, whatever ends in between, and the same bits by every engine.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use crate::program::{fresh, root, succeed};

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
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("plychain"));
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

/// The bits of every run's chain.
fn chains(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder.join("runs")).unwrap();
    let chain = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(path.join("chain.csv")).unwrap())
    };
    entries.map(|e| chain(e.unwrap().path())).collect()
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
        let alone = std::fs::read(bench.place.join(&out).join("chain.csv")).unwrap();
        assert!(whole[&format!("mock-coupon-{k}")] == alone);
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
    let zarr = read_json(&bench.place.join("whole/collected.zarr/zarr.json"));
    assert_eq!(zarr["attributes"]["runs"].as_array().unwrap().len(), 3);
    let bytes = std::fs::read(bench.place.join("whole/collected.zarr/E1_GPa_mean/c/0")).unwrap();
    let stored = bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|w| f64::from_le_bytes(*w));
    assert_eq!(stored.collect::<Vec<_>>(), means);
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
    let chain = |name: &str| std::fs::read(bench.place.join(name).join("chain.csv")).unwrap();
    assert!(chain("told") == chain("whole"));
}

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

/// A calibration in shares gives the record of one that was run in one process, and the same table.
#[test]
fn shares_of_a_calibration_make_the_same_table() {
    let bench = Bench::new(1);
    bench.write(
        "campaign.json",
        &json!({ "schema": "plychain-campaign/1", "name": "calibration", "verb": "calibrate", "models": "mock.json",
            "calibration": { "replicates": 5, "shares": 2, "correlation_mm": [0], "grid": 15, "reduced": true } }),
    );
    bench.succeed(&["campaign", "campaign.json", "--out", "shares"]);
    assert!(all_done(&bench.manifest("shares")));
    let table = bench.succeed(&["campaign", "collect", "shares"]);
    let plain = [
        "validate",
        "mock.json",
        "--sbc",
        "5",
        "--reduced",
        "--grid",
        "15",
        "--correlation-mm",
        "0",
    ];
    let whole = bench.succeed(&[&plain[..], &["--out", "whole"]].concat());
    let text = |of: &str| of.split("written to").next().unwrap().to_string();
    assert!(table.contains(&text(&whole)), "{table}\n{whole}");
    let folder = bench.place.join("shares/runs/mock");
    let of = |path: PathBuf| std::fs::read_to_string(path).unwrap();
    let numbers = of(folder.join("validation.json"));
    assert_eq!(numbers, of(bench.place.join("whole/validation.json")));
    let lines = |text: String| text.lines().skip(1).map(String::from).collect::<Vec<_>>();
    let shares = [1, 2].map(|k| lines(of(folder.join(format!("sbc-0mm.share-{k}-of-2.jsonl")))));
    assert_eq!(shares.each_ref().map(Vec::len), [3, 2]);
    let mut merged = shares.concat();
    merged.sort();
    let mut whole = lines(of(bench.place.join("whole/sbc-0mm.jsonl")));
    whole.sort();
    assert_eq!(merged, whole);
}

/// An array is submitted once, of the tasks that are neither done nor queued; what its tasks do is what a local campaign does.
#[test]
#[cfg(unix)]
fn an_array_has_the_tasks_that_are_missing() {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::new(5);
    bench.coupons(3000);
    let bin = bench.place.join("bin");
    std::fs::create_dir(&bin).unwrap();
    let script = |name: &str, text: &str| {
        let path = bin.join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    // runs the tasks one after the other before it answers
    script(
        "sbatch",
        "echo \"$@\" >>sbatch.log\nfor k in $(sed -n 's/^#SBATCH --array=//p' \"$2\" | tr , ' '); do\n\
         SLURM_ARRAY_TASK_ID=$k sh \"$2\" >>tasks.log 2>&1\ndone\necho 17",
    );
    script("squeue", "cat queue");
    let queue = |text: &str| std::fs::write(bench.place.join("queue"), text).unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let slurm = [
        "campaign",
        "campaign.json",
        "--engine",
        "slurm",
        "--runs-a-task",
        "2",
        "--out",
        "array",
        "--resume",
    ];
    let run = |more: &[&str]| {
        let mut command = bench.command(&[&slurm[..], more].concat());
        command.env("PATH", &path).output().unwrap()
    };
    queue("");
    let shown = run(&[
        "--dry-run",
        "--time",
        "2:00:00",
        "--sbatch=--partition=long",
    ]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    for line in [
        "#SBATCH --array=1,2,3",
        "#SBATCH --time=2:00:00",
        "#SBATCH --partition=long",
        "#SBATCH --signal=B:TERM@60",
    ] {
        assert!(shown.lines().any(|l| l == line), "{line} in\n{shown}");
    }
    assert!(!bench.place.join("sbatch.log").exists());
    // the second task is queued by an earlier call
    queue("2 RUNNING\n");
    let end = run(&[]);
    assert!(end.status.success(), "{end:?}");
    let states = |manifest: &Value| -> Vec<String> {
        let runs = manifest["runs"].as_array().unwrap();
        let state = |r: &Value| r["state"].as_str().unwrap().to_string();
        runs.iter().map(state).collect()
    };
    let found = states(&bench.manifest("array"));
    assert_eq!(found, ["done", "waiting", "done", "done", "waiting"]);
    queue("");
    let end = run(&["--wait"]);
    assert!(end.status.success(), "{end:?}");
    assert!(all_done(&bench.manifest("array")));
    assert!(bench.attempts("array").values().all(|n| *n == 1));
    run(&[]);
    let submitted = std::fs::read_to_string(bench.place.join("sbatch.log")).unwrap();
    assert_eq!(submitted.lines().count(), 2);
    bench.succeed(&["campaign", "campaign.json", "--out", "local"]);
    let of = |name: &str| chains(&bench.place.join(name));
    assert!(of("array") == of("local"));
    // a queue that does not answer is no empty one
    script("squeue", "echo no controller >&2; exit 1");
    let end = run(&[]);
    assert_eq!(end.status.code(), Some(1));
    assert!(
        String::from_utf8(end.stderr)
            .unwrap()
            .contains("no controller")
    );
}

/// On a real Slurm: the same bits as here, and a task that is cancelled is run again.
#[test]
#[ignore = "needs Slurm"]
fn a_cancelled_task_of_a_real_array_is_run_again() {
    let bench = Bench::new(4);
    bench.coupons(1_000_000);
    let slurm = [
        "campaign",
        "campaign.json",
        "--engine",
        "slurm",
        "--runs-a-task",
        "2",
        "--out",
        "array",
    ];
    let all = [&slurm[..], &["--resume", "--wait"]].concat();
    let child = bench.command(&all).spawn().unwrap();
    let begun = bench.place.join("array/runs/mock-coupon-1/checkpoint");
    wait("the first task runs", || begun.exists());
    let name = std::fs::read_to_string(bench.place.join("array/slurm/script.sh")).unwrap();
    let name = name
        .lines()
        .find_map(|l| l.strip_prefix("#SBATCH --job-name="));
    let queue = Command::new("squeue")
        .args(["--noheader", "--me", "--format=%F", "--name", name.unwrap()])
        .output()
        .unwrap();
    let job = String::from_utf8(queue.stdout).unwrap();
    let task = format!("{}_1", job.lines().next().unwrap().trim());
    assert!(
        Command::new("scancel")
            .arg(&task)
            .status()
            .unwrap()
            .success()
    );
    let end = child.wait_with_output().unwrap();
    assert_eq!(end.status.code(), Some(75), "{end:?}");
    let stopped = bench.manifest("array");
    assert_eq!(stopped["runs"][0]["state"], "to_be_resumed");
    bench.succeed(&all);
    let ended = bench.manifest("array");
    assert!(all_done(&ended));
    // how often the others were begun is Slurm's: it requeues what a slow node does not acknowledge
    for (before, after) in std::iter::zip(
        stopped["runs"].as_array().unwrap(),
        ended["runs"].as_array().unwrap(),
    ) {
        let again = u64::from(before["state"] != "done");
        let attempts = |run: &Value| run["attempts"].as_u64().unwrap();
        assert_eq!(
            attempts(after),
            attempts(before) + again,
            "{stopped} {ended}"
        );
    }
    bench.succeed(&["campaign", "campaign.json", "--out", "local"]);
    assert!(chains(&bench.place.join("array")) == chains(&bench.place.join("local")));
}

/// Of processes that want the same reduced model at one moment, one builds it.
#[test]
fn a_reduced_model_is_built_once() {
    let bench = Bench::new(0);
    let text = std::fs::read_to_string(root().join("models/openhole.json")).unwrap();
    let mut model: Value = serde_json::from_str(&text).unwrap();
    model["experiments"][0]["measurement"]["dir"] =
        root().join("models/openhole").display().to_string().into();
    model["experiments"][0]["mesh_density"] = 0.3.into();
    bench.write("coarse.json", &model);
    let build = || {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("plychain"));
        command.current_dir(&bench.place);
        command.args(["build", "coarse.json", "--threads", "1"]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let children: Vec<Child> = (0..3).map(|_| build()).collect();
    let built = children.into_iter().map(|child| {
        let end = child.wait_with_output().unwrap();
        assert!(end.status.success(), "{end:?}");
        let said = String::from_utf8(end.stderr).unwrap();
        said.matches("finite-element snapshots (").count()
    });
    let built: usize = built.sum();
    let cache = std::fs::read_dir(bench.place.join("runs/.cache")).unwrap();
    let names = cache.map(|e| e.unwrap().path());
    let models = names.inspect(|p| assert!(p.extension().unwrap() == "json", "{p:?} is left"));
    assert_eq!(built, models.count());
}

/// The material of a campaign's specimens: its files are chains like any other, the same for any number of threads; one measurement is one
/// specimen, and what is left out is said.
#[test]
fn a_population_is_made_of_the_specimens_of_a_campaign() {
    let bench = Bench::new(5);
    bench.coupons(4000);
    bench.succeed(&["campaign", "campaign.json", "--out", "whole"]);
    let said = bench.succeed(&["campaign", "population", "whole", "--threads", "1"]);
    assert!(said.contains("population of 5 specimens"), "{said}");
    let chain = || std::fs::read(bench.place.join("whole/population/chain.csv")).unwrap();
    let first = chain();
    bench.succeed(&["campaign", "population", "whole", "--threads", "2"]);
    assert_eq!(first, chain());
    let report = read_json(&bench.place.join("whole/population/population.json"));
    assert_eq!(report["schema"], "plychain-population/1");
    // E1 is 151, 152, 153, 150, 151 GPa in turn, each measured to about a percent
    let e1 = &report["constants"]["E1_GPa"];
    let at = |path: &str| e1.pointer(path).unwrap().as_f64().unwrap();
    assert!(
        (at("/mean/mean") - 151.4).abs() < 4.0 * at("/mean/sd"),
        "{e1}"
    );
    assert!(at("/a_basis/value") < at("/b_basis/value"), "{e1}");
    assert!(at("/b_basis/value") < at("/mean/low"), "{e1}");
    let judged = bench.succeed(&["diagnose", "whole/population"]);
    assert!(judged.contains("percentile_10_E1_GPa"), "{judged}");

    let run = report["specimens"]
        .as_object()
        .unwrap()
        .keys()
        .next()
        .unwrap()
        .clone();
    let said = bench.succeed(&["campaign", "population", "whole", "--leave-out", &run]);
    assert!(
        said.contains(&format!("not among the specimens: {run}")),
        "{said}"
    );
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
