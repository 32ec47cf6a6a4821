//! Shares of a campaign: those of a calibration, and the tasks of a Slurm array.

use std::sync::{Mutex, PoisonError};

use super::*;

/// Held by tests of the real Slurm: one of them kills its controller.
static ONE_SLURM: Mutex<()> = Mutex::new(());

/// The campaign as an array that is waited for.
fn waited(out: &str) -> [&str; 10] {
    let [campaign, file] = ["campaign", "campaign.json"];
    [
        campaign,
        file,
        "--engine",
        "slurm",
        "--runs-a-task",
        "2",
        "--out",
        out,
        "--resume",
        "--wait",
    ]
}

/// The name of the array's jobs.
fn job_name(bench: &Bench, out: &str) -> String {
    let script = bench.place.join(out).join("slurm/script.sh");
    let script = std::fs::read_to_string(script).unwrap();
    let mut lines = script.lines();
    let name = lines.find_map(|l| l.strip_prefix("#SBATCH --job-name="));
    name.unwrap().to_string()
}

/// A calibration in shares gives the replicates of one that was run in one process, and the same table.
#[test]
fn shares_of_a_calibration_make_the_same_table() {
    let bench = Bench::new(1);
    bench.write(
        "campaign.json",
        &json!({ "schema": "plychain-campaign/1", "name": "calibration", "verb": "calibrate", "models": "mock.json",
            "calibration": { "replicates": 5, "shares": 2, "correlation_mm": [0], "grid": 15 } }),
    );
    bench.succeed(&["campaign", "campaign.json", "--out", "shares"]);
    assert!(all_done(&bench.manifest("shares")));
    let table = bench.succeed(&["campaign", "collect", "shares"]);
    let plain = [
        "validate",
        "mock.json",
        "--calibrate",
        "5",
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
    for k in 0..5 {
        let file = format!("calibration-0mm/{k}.json");
        let whole = bench.place.join("whole").join(&file);
        assert_eq!(of(folder.join(file)), of(whole), "{k}");
    }
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
    let _alone = ONE_SLURM.lock().unwrap_or_else(PoisonError::into_inner);
    let bench = Bench::new(4);
    bench.coupons(1_000_000);
    let all = waited("array");
    let child = bench.command(&all).spawn().unwrap();
    let begun = bench.place.join("array/runs/mock-coupon-1/checkpoint");
    wait("the first task runs", || begun.exists());
    let name = job_name(&bench, "array");
    let queue = Command::new("squeue")
        .args(["--noheader", "--me", "--format=%F", "--name", &name])
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

/// The controller of a real Slurm dies while the array runs, and comes back: nothing is lost, and nothing is done twice that was done.
#[test]
#[ignore = "needs Slurm"]
fn an_array_outlives_its_controller() {
    let _alone = ONE_SLURM.lock().unwrap_or_else(PoisonError::into_inner);
    let bench = Bench::new(4);
    bench.coupons(1_000_000);
    let all = waited("outlived");
    let child = bench.command(&all).spawn().unwrap();
    let begun = bench.place.join("outlived/runs/mock-coupon-1/checkpoint");
    wait("the first task runs", || begun.exists());
    let configuration = std::env::var("SLURM_CONF").unwrap();
    let text = std::fs::read_to_string(&configuration).unwrap();
    let pid_file = text
        .lines()
        .find_map(|l| l.strip_prefix("SlurmctldPidFile="))
        .unwrap();
    let pid = std::fs::read_to_string(pid_file).unwrap();
    let killed = Command::new("kill")
        .args(["-9", pid.trim()])
        .status()
        .unwrap();
    assert!(killed.success());
    let is_up = || {
        let asked = Command::new("squeue").arg("--noheader").output().unwrap();
        asked.status.success()
    };
    assert!(!is_up());
    std::thread::sleep(std::time::Duration::from_secs(3));
    assert!(Command::new("slurmctld").status().unwrap().success());
    wait("the controller is back", is_up);
    let end = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&end.stderr).into_owned();
    // a controller that dies before it has written down that tasks run starts them twice, and holds them: that is said
    assert!([Some(0), Some(75)].contains(&end.status.code()), "{said}");
    let before = bench.manifest("outlived");
    if said.contains("held by Slurm") {
        let command = |words: &[&str]| {
            let done = Command::new(words[0]).args(&words[1..]).status().unwrap();
            assert!(done.success(), "{words:?}");
        };
        let again = bench.command(&all).output().unwrap();
        let again = String::from_utf8_lossy(&again.stderr).into_owned();
        assert!(again.contains("held by Slurm"), "{again}");
        command(&["scontrol", "update", "NodeName=localhost", "State=RESUME"]);
        let name = job_name(&bench, "outlived");
        command(&["scancel", "--name", &name]);
        let is_empty = || {
            let asked = Command::new("squeue")
                .args(["--noheader", "--name", &name])
                .output();
            asked.unwrap().stdout.is_empty()
        };
        wait("the queue is empty", is_empty);
    }
    bench.succeed(&all);
    let after = bench.manifest("outlived");
    assert!(all_done(&after));
    let runs = |manifest: &Value| manifest["runs"].as_array().unwrap().clone();
    for (before, after) in std::iter::zip(runs(&before), runs(&after)) {
        if before["state"] == "done" {
            assert_eq!(before["attempts"], after["attempts"], "{before} {after}");
        }
    }
    bench.succeed(&["campaign", "campaign.json", "--out", "alone"]);
    assert!(chains(&bench.place.join("outlived")) == chains(&bench.place.join("alone")));
}
