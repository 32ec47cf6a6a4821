//! A run that is killed at any moment goes on to the same bits; stores that are damaged or of another run are refused.

mod faults;
mod kept;
mod stages;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use plychain::chain::read_zarr;

use crate::common::{changed, program, set_coarse};

/// A place with a small simulated measurement.
struct Bench {
    place: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self {
            place: tempfile::tempdir().unwrap(),
        };
        let model = model();
        let simulated = bench.run(&["simulate", &model, "--grid", "31", "--out", "data"]);
        assert!(simulated.status.success(), "{simulated:?}");
        bench
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = program();
        command
            .current_dir(self.place.path())
            .arg("--quiet")
            .args(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }
}

/// The open-hole model on a coarse mesh with a small reduced model, so that a test does not wait for snapshots.
fn model() -> String {
    changed("openhole.json", |m| {
        set_coarse(m);
        m["reduced_model"]["snapshots"] = 60.into();
        m["experiments"][0]["measurement"]["dir"] = "data".into();
    })
}

/// A run that lasts some seconds: it wants more effective draws than it may draw.
fn identify<'a>(model: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec![
        "identify",
        model,
        "--data",
        "data",
        "--out",
        out,
        "--min-ess",
        "1e9",
        "--max-draws",
        "3000000",
    ];
    arguments.extend(more);
    arguments
}

fn assert_same_chains(a: &Path, b: &Path) {
    let bits = |path: &Path| {
        let draws = read_zarr(&path.join("chain.zarr"), None).unwrap();
        let values = draws.values().iter().chain(draws.lp());
        (
            draws.names().to_vec(),
            values.map(|v| v.to_bits()).collect::<Vec<_>>(),
        )
    };
    let (a_bits, b_bits) = (bits(a), bits(b));
    assert_eq!(a_bits.1.len(), b_bits.1.len());
    assert!(a_bits == b_bits, "the chains differ");
}

/// Moments of kills: a small generator of its own, so that they are the same in every run of the test.
fn moments() -> impl Iterator<Item = Duration> {
    let mut state = 2026_u64;
    std::iter::repeat_with(move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        Duration::from_millis(150 + (state >> 33) % 1800)
    })
}

/// Kills a process (SIGKILL: it cannot clean up) after a moment if it `may`; false if it came to its end.
fn killed(mut child: Child, moment: Duration, may: bool) -> bool {
    std::thread::sleep(moment);
    if may && child.try_wait().unwrap().is_none() {
        child.kill().unwrap();
        child.wait().unwrap();
        return true;
    }
    let end = child.wait_with_output().unwrap();
    assert!(end.status.success(), "{end:?}");
    false
}

#[test]
fn a_killed_run_goes_on_to_the_same_bits() {
    killed_times(4);
}

#[test]
#[ignore = "20 kills, 1 minute"]
fn a_run_killed_many_times_goes_on_to_the_same_bits() {
    killed_times(20);
}

fn killed_times(most: usize) {
    let bench = Bench::new();
    let model = model();
    let whole = bench.run(&identify(&model, "whole", &[]));
    assert!(whole.status.success(), "{whole:?}");
    let mut kills = 0;
    let mut round = 0;
    let mut moments = moments();
    while kills < most {
        let out = format!("killed-{round}");
        round += 1;
        assert!(round <= 2 * most, "the runs end before they are killed");
        loop {
            let child = bench
                .command(&identify(&model, &out, &["--resume"]))
                .spawn()
                .unwrap();
            if !killed(child, moments.next().unwrap(), kills < most) {
                break;
            }
            kills += 1;
        }
        assert_same_chains(&bench.path("whole"), &bench.path(&out));
    }
}

/// A loop that is killed in any of its rounds ends with the report of one that was not.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_killed_loop_goes_on_to_the_same_report() {
    let bench = Bench::new();
    let model = model();
    let misaligned = [
        "simulate",
        &model,
        "--grid",
        "61",
        "--effect",
        "load_misalignment=1",
        "--noise-nm",
        "10",
        "--out",
        "leaning",
    ];
    assert!(bench.run(&misaligned).status.success());
    let close = |out: &str, more: &[&str]| -> Vec<String> {
        let all = [
            "loop",
            "--csv",
            &model,
            "--data",
            "leaning",
            "--max-draws",
            "150000",
            "--min-ess",
            "1e9",
            "--out",
            out,
        ];
        all.iter().chain(more).map(ToString::to_string).collect()
    };
    let command = |arguments: &[String]| {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        bench.command(&arguments)
    };
    let whole = command(&close("whole", &[])).output().unwrap();
    assert!(whole.status.success(), "{whole:?}");
    let mut kills = 0;
    for mut moment in moments() {
        let child = command(&close("killed", &["--resume"])).spawn().unwrap();
        // later and later, so that every round has its turn
        moment += Duration::from_millis(600 * kills);
        if !killed(child, moment, kills < 6) {
            break;
        }
        kills += 1;
    }
    assert!(kills > 2, "{kills} kills");
    assert_same_chains(&bench.path("whole"), &bench.path("killed"));
    assert_same_chains(&bench.path("whole/round-1"), &bench.path("killed/round-1"));
    let averaged = |name: &str| std::fs::read(bench.path(name).join("averaged/chain.csv")).unwrap();
    assert!(
        averaged("whole") == averaged("killed"),
        "the draws to quote differ"
    );
    let report = |name: &str| {
        let text = std::fs::read_to_string(bench.path(name).join("report.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let (whole, killed) = (report("whole"), report("killed"));
    assert_eq!(whole["verdict"]["effects"][0], "load_misalignment");
    for key in [
        "averaged_posterior",
        "before_after",
        "verdict",
        "blind_spots",
    ] {
        assert_eq!(whole[key], killed[key], "{key}");
    }
    // another verb would write over what the loop left
    let other = identify(&model, "whole", &["--resume"]);
    let refused = bench.run(&other);
    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("a finished run of loop"), "{said}");
    assert!(report("whole")["verdict"].is_object());
}

fn refused(bench: &Bench, arguments: &[&str], words: &str) {
    let store = bench.path("run");
    // a stage of another identity is kept beside the store, and never taken for one of this run
    let contents = |folder: &Path| {
        let mut all = contents(folder);
        all.retain(|(path, _)| !path.components().any(|c| c.as_os_str() == "stages"));
        all
    };
    let before = contents(&store);
    let output = bench.run(arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains(words), "{text}");
    assert!(contents(&store) == before, "a refused store was changed");
}

/// Every file below a folder.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(contents(&path));
        } else {
            all.push((path.clone(), std::fs::read(&path).unwrap()));
        }
    }
    all.sort();
    all
}

#[test]
fn damaged_and_foreign_stores_are_refused() {
    let bench = Bench::new();
    let model = model();
    let short = [
        "identify",
        &model,
        "--data",
        "data",
        "--out",
        "run",
        "--max-draws",
        "20000",
    ];
    let first = bench.run(&short);
    assert!(first.status.success(), "{first:?}");
    let resume: Vec<&str> = short.iter().copied().chain(["--resume"]).collect();
    let with = |more: &[&'static str]| [resume.clone(), more.to_vec()].concat();
    refused(&bench, &short, "does not exist yet");
    refused(&bench, &with(&["--seed", "7"]), "seed");
    refused(&bench, &with(&["--sampler", "adaptive"]), "sampler");
    // Another model, and another measurement in the place of the first.
    let text = std::fs::read_to_string(&model).unwrap();
    let other = bench.path("other.json").display().to_string();
    std::fs::write(&other, text.replace("\"sd\":16.0", "\"sd\":17.0")).unwrap();
    let mut changed = resume.clone();
    changed[1] = &other;
    refused(&bench, &changed, "model_sha256");
    let again = [
        "simulate", &model, "--grid", "31", "--seed", "9", "--out", "other",
    ];
    assert!(bench.run(&again).status.success());
    let file = bench.path("data/U.txt");
    let measured = std::fs::read(&file).unwrap();
    std::fs::copy(bench.path("other/U.txt"), &file).unwrap();
    refused(&bench, &resume, "data_sha256");
    std::fs::write(&file, measured).unwrap();
    let spoil = |name: &str, change: &dyn Fn(&mut Vec<u8>), words: &str| {
        let path = bench.path("run").join(name);
        let good = std::fs::read(&path).unwrap();
        let mut bad = good.clone();
        change(&mut bad);
        std::fs::write(&path, &bad).unwrap();
        refused(&bench, &resume, words);
        std::fs::write(&path, &good).unwrap();
    };
    let chunk = "chain.zarr/posterior/E1_GPa/c/0/0";
    spoil("checkpoint", &|b| b[200] ^= 1, "checksum");
    spoil("checkpoint", &|b| b.truncate(500), "damaged");
    spoil(chunk, &|b| b[1000] ^= 1, "damaged");
    spoil(chunk, &|b| b.truncate(b.len() - 8), "numbers of 8 bytes");
    spoil("chain.zarr/zarr.json", &|b| b.truncate(100), "valid JSON");
    let again = bench.run(&resume);
    assert!(again.status.success(), "{again:?}");
}
