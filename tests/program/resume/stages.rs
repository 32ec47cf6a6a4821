//! Finished stages of a loop are kept: a run that is killed after each of them does none twice, and ends with the bits of one that was not.

use std::collections::BTreeMap;

use super::*;

/// A loop that finds a leaning load, small.
fn leaning() -> (Bench, String) {
    let bench = Bench::new();
    let model = model();
    let arguments = [
        "simulate",
        &model,
        "--grid",
        "41",
        "--effect",
        "load_misalignment=1",
        "--noise-nm",
        "10",
        "--out",
        "leaning",
    ];
    assert!(bench.run(&arguments).status.success());
    (bench, model)
}

/// A loop over a small series that finds a leaning load.
fn leaning_series() -> (Bench, String) {
    let bench = Bench::new();
    let made = bench.run(&["init", "rig", "--subset-mm", "1"]);
    assert!(made.status.success(), "{made:?}");
    let file = bench.path("rig.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let mut model: serde_json::Value = serde_json::from_str(&text).unwrap();
    set_coarse(&mut model);
    model["reduced_model"]["snapshots"] = 60.into();
    std::fs::write(&file, model.to_string()).unwrap();
    let arguments = [
        "simulate",
        "rig.json",
        "--steps",
        "0,700,1400,2100",
        "--grid",
        "31",
        "--effect",
        "load_misalignment=1",
        "--noise-nm",
        "100",
        "--out",
        "leaning",
    ];
    let made = bench.run(&arguments);
    assert!(made.status.success(), "{made:?}");
    (bench, "leaning/model.json".to_string())
}

/// The loop, which says what it does.
fn close(bench: &Bench, model: &str, out: &str, more: &[&str]) -> Command {
    let mut command = program();
    command.current_dir(bench.place.path());
    command.args(["loop", "--csv", model, "--out", out]);
    if !model.starts_with("leaning") {
        command.args(["--data", "leaning"]);
    }
    command.args(["--max-draws", "20000", "--min-ess", "1e9", "--verbose"]);
    command.args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Files of finished stages below a folder.
fn stages(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut left = vec![folder.to_path_buf()];
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let is_whole = path.extension().is_none_or(|e| e != "new");
            if path.is_dir() {
                left.push(path);
            } else if folder.ends_with("stages") && is_whole {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// How often each stage of tracing and of the posterior to quote came to its end, by what was said.
fn ended(said: &str, counts: &mut BTreeMap<String, usize>) {
    for line in said.lines() {
        let is_kept = line.starts_with("  tracing, pass") || line.starts_with("  quoted posterior");
        let what = line.rsplit_once(" (").map(|(what, _)| what);
        // how far it had come is no part of its name
        let what = what.map(|w| w.split(": sampling").next().unwrap_or(w).to_string());
        if let Some(what) = what.filter(|_| is_kept && line.ends_with(" s)")) {
            *counts.entry(what).or_default() += 1;
        }
    }
}

fn report(bench: &Bench, name: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(bench.path(name).join("report.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn a_loop_killed_after_every_stage_does_none_twice() {
    let (bench, model) = leaning();
    killed_after_every_stage(&bench, &model);
}

#[test]
#[ignore = "length: a loop for each stage, 3 minutes"]
fn a_loop_over_a_series_killed_after_every_stage_does_none_twice() {
    let (bench, model) = leaning_series();
    killed_after_every_stage(&bench, &model);
}

fn killed_after_every_stage(bench: &Bench, model: &str) {
    let whole = close(bench, model, "whole", &[]).output().unwrap();
    let said = String::from_utf8_lossy(&whole.stderr).into_owned();
    assert!(whole.status.success(), "{said}");
    let mut once = BTreeMap::new();
    ended(&said, &mut once);
    assert!(once.len() >= 4, "{once:?}");
    assert_eq!(stages(&bench.path("whole")), [] as [PathBuf; 0]);

    let mut counts = BTreeMap::new();
    let (mut kills, mut known) = (0, 0);
    let mut damaged: Option<PathBuf> = None;
    let log = bench.path("log.txt");
    let end = loop {
        let file = std::fs::File::create(&log).unwrap();
        let mut command = close(bench, model, "killed", &["--resume"]);
        let mut child = command.stderr(file).spawn().unwrap();
        let ended_alone = loop {
            if child.try_wait().unwrap().is_some() {
                break true;
            }
            let now = stages(&bench.path("killed"));
            if now.len() > known {
                child.kill().unwrap();
                child.wait().unwrap();
                known = now.len();
                break false;
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        let said = std::fs::read_to_string(&log).unwrap();
        if let Some(path) = damaged.take() {
            let words = format!(
                "{} is damaged",
                path.strip_prefix(bench.place.path()).unwrap().display()
            );
            assert!(said.contains(&words), "{said}");
            // it was done again, as it should
        } else {
            ended(&said, &mut counts);
        }
        if ended_alone {
            break child.wait_with_output().unwrap();
        }
        kills += 1;
        assert!(kills < 100, "no end: {:?}", stages(&bench.path("killed")));
        // once a file is cut: the stage is done again, and no other
        if kills == 4 {
            let all = stages(&bench.path("killed"));
            let path = all
                .iter()
                .find(|p| p.to_str().unwrap().contains("sensitivities"));
            let path = path.unwrap().clone();
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            damaged = Some(path);
            // what is made again is no new file: the process is killed at the next one
        }
    };
    let said = std::fs::read_to_string(&log).unwrap();
    assert!(end.status.success(), "{said}");
    assert!(kills >= 8, "{kills} kills");
    for (what, count) in &counts {
        let most = once.get(what).copied().unwrap_or(0);
        assert!(
            *count <= most,
            "{what}: {count} times, {most} in one run\n{counts:#?}"
        );
    }
    assert_same_chains(&bench.path("whole"), &bench.path("killed"));
    assert_same_chains(&bench.path("whole/round-1"), &bench.path("killed/round-1"));
    let quoted = |name: &str| std::fs::read(bench.path(name).join("averaged/chain.csv")).unwrap();
    assert!(
        quoted("whole") == quoted("killed"),
        "the draws to quote differ"
    );
    assert_eq!(report(bench, "whole"), report(bench, "killed"));
    assert_eq!(
        report(bench, "whole")["verdict"]["effects"][0],
        "load_misalignment"
    );
}

/// A disk that is full when a stage is to be written: the loop ends with these words, and goes on to the same bits with what was finished. A
/// stage that found no room is done again, and no other.
#[test]
#[cfg(target_os = "linux")]
#[ignore = "slow: run by .ci/run"]
fn a_disk_full_at_every_stage_costs_that_stage_alone() {
    let (bench, model) = leaning();
    let library =
        faults::shim(bench.place.path()).expect("a C compiler, which Rust links with too");
    let whole = close(&bench, &model, "whole", &[]).output().unwrap();
    let mut once = BTreeMap::new();
    ended(&String::from_utf8_lossy(&whole.stderr), &mut once);
    let mut counts = BTreeMap::new();
    let mut full = 0;
    loop {
        let mut command = close(&bench, &model, "full", &["--resume"]);
        command.env("LD_PRELOAD", &library);
        command.env("FAULT_BELOW", "/stages/").env("FAULT_AT", "2");
        let end = command.output().unwrap();
        let said = String::from_utf8_lossy(&end.stderr).into_owned();
        ended(&said, &mut counts);
        if end.status.success() {
            break;
        }
        assert_eq!(end.status.code(), Some(1), "{said}");
        assert!(said.contains("the disk is full"), "{said}");
        full += 1;
        assert!(full < 60, "no end");
    }
    assert!(full >= 4, "{full} times full");
    let done: usize = counts.values().sum();
    let wanted: usize = once.values().sum();
    assert!(
        done <= wanted + full,
        "{done} stages, {wanted} in one run, {full} found no room\n{counts:#?}"
    );
    assert_same_chains(&bench.path("whole"), &bench.path("full"));
    assert_eq!(report(&bench, "whole"), report(&bench, "full"));
}

/// Fifty kills at random places of a loop.
#[test]
#[ignore = "length: 50 kills, 5 minutes"]
fn a_loop_killed_at_fifty_places_ends_with_the_same_bits() {
    let (bench, model) = leaning();
    let began = std::time::Instant::now();
    let whole = close(&bench, &model, "whole", &[]).output().unwrap();
    assert!(whole.status.success(), "{whole:?}");
    // a kill every fifth of the time that the whole takes
    let fifth = began.elapsed() / 5;
    let (mut kills, mut runs) = (0, 0);
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut moments = moments();
    let log = bench.path("log.txt");
    while kills < 50 {
        let out = format!("killed-{runs}");
        runs += 1;
        loop {
            let file = std::fs::File::create(&log).unwrap();
            let mut command = close(&bench, &model, &out, &["--resume"]);
            let child = command.stderr(file).spawn().unwrap();
            let share = moments.next().unwrap().as_secs_f64() / 0.95;
            if !killed(child, fifth.mul_f64(share), kills < 50) {
                break;
            }
            kills += 1;
            let said = std::fs::read_to_string(&log).unwrap();
            let last = said.lines().rfind(|line| line.ends_with(" s)"));
            let last = last
                .and_then(|line| line.rsplit_once(" ("))
                .map_or("", |(what, _)| what);
            *places.entry(last.trim().to_string()).or_default() += 1;
        }
        assert_same_chains(&bench.path("whole"), &bench.path(&out));
        assert_eq!(report(&bench, "whole"), report(&bench, &out));
    }
    println!("{kills} kills in {runs} runs, after\n{places:#?}");
}

/// A finished loop that is asked for again prints its result from its files; other arguments, another model or draws that were changed are
/// not passed over.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_finished_loop_answers_from_its_files() {
    let (bench, model) = leaning();
    let first = close(&bench, &model, "run", &["--rounds", "1"])
        .output()
        .unwrap();
    assert!(first.status.success(), "{first:?}");
    let before = contents(&bench.path("run"));
    let again = |rounds: &str| {
        let more = ["--rounds", rounds, "--resume"];
        let end = close(&bench, &model, "run", &more).output().unwrap();
        let [out, err] =
            [&end.stdout, &end.stderr].map(|b| String::from_utf8_lossy(b).into_owned());
        (end.status.code(), out, err)
    };
    let (code, out, err) = again("1");
    assert_eq!(code, Some(0), "{err}");
    assert!(!err.contains(" s)"), "a stage was gone through: {err}");
    assert!(contents(&bench.path("run")) == before, "files were written");
    let result = String::from_utf8(first.stdout).unwrap();
    let result = result.split("written to").next().unwrap();
    assert!(out.starts_with(result), "{out}\n{result}");
    assert!(out.contains("done before: run"), "{out}");
    let chunk = bench.path("run/averaged/chain.zarr/posterior/E1_GPa/c/0/0");
    let good = std::fs::read(&chunk).unwrap();
    let other = bench.path("run/averaged/chain.zarr/posterior/E2_GPa/c/0/0");
    std::fs::copy(other, &chunk).unwrap();
    let (code, _, err) = again("1");
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("posterior/E1_GPa"), "{err}");
    std::fs::write(&chunk, good).unwrap();
    assert_eq!(again("1").0, Some(0));
    // another argument is another request
    let (code, out, err) = again("0");
    assert_eq!(code, Some(0), "{err}");
    assert!(!out.contains("done before") && err.contains(" s)"), "{out}");
    assert!(again("0").1.contains("done before"));
}
