//! What a dry run leaves, what a scheduler's answers mean, and how a campaign says that it stands.

use super::*;
use crate::common::{copy, plychain_in, program, shared};

/// A folder of stubs on the path before all others.
#[cfg(unix)]
fn stubs(place: &Path, all: &[(&str, &str)]) -> String {
    use std::os::unix::fs::PermissionsExt;
    let bin = place.join("bin");
    std::fs::create_dir_all(&bin).unwrap();
    for (name, text) in all {
        let path = bin.join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    format!("{}:{}", bin.display(), std::env::var("PATH").unwrap())
}

/// Everything below a folder, by path.
fn below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut left = vec![folder.to_path_buf()];
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                left.push(path.clone());
            }
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn a_dry_run_leaves_nothing_behind() {
    let bench = Bench::new(1);
    bench.write(
        "campaign.json",
        &json!({ "schema": "plychain-campaign/1", "name": "dry", "verb": "identify", "models": "mock.json",
            "sweep": { "experiments.0.load.force_N": [600, 700] }, "seeds": { "from": 1, "count": 2 } }),
    );
    let before = below(&bench.place);
    for engine in ["local", "slurm"] {
        let arguments = ["campaign", "campaign.json", "--engine", engine, "--dry-run"];
        let end = bench.run(&arguments);
        let said = String::from_utf8(end.stdout.clone()).unwrap();
        assert!(end.status.success(), "{end:?}");
        // the model with keys set is named where the run will have it
        assert!(
            engine == "slurm" || said.contains("runs/dry/models/"),
            "{said}"
        );
        assert_eq!(below(&bench.place), before, "{engine}");
        assert_eq!(bench.run(&arguments).stdout, end.stdout);
    }
}

#[test]
#[cfg(unix)]
fn an_answer_without_a_job_s_number_is_an_error_and_a_banner_is_none() {
    let bench = Bench::new(1);
    bench.coupons(1000);
    let run = |sbatch: &str, out: &str| {
        let path = stubs(
            &bench.place,
            &[("sbatch", sbatch), ("squeue", "echo '2026 maintenance'")],
        );
        let arguments = [
            "campaign",
            "campaign.json",
            "--engine",
            "slurm",
            "--verbose",
            "--out",
            out,
        ];
        // what is submitted is said as progress
        let mut command = program();
        let end = command
            .current_dir(&bench.place)
            .args(arguments)
            .env("PATH", path)
            .output();
        let end = end.unwrap();
        let text = String::from_utf8([end.stdout, end.stderr].concat()).unwrap();
        (end.status.code(), text)
    };
    for (k, (sbatch, job)) in [
        ("echo ------; echo '  Welcome 2026'; echo 4712", "4712"),
        ("echo '4713;cluster'", "4713"),
        ("echo Submitted batch job 4714", "4714"),
    ]
    .into_iter()
    .enumerate()
    {
        let (code, text) = run(sbatch, &format!("banner-{k}"));
        assert_eq!(code, Some(0), "{text}");
        assert!(
            text.contains(&format!("job {job}: 1 tasks submitted")),
            "{text}"
        );
    }
    for (k, (sbatch, expected)) in [
        ("exit 0", ["no answer", "nothing counts as submitted"]),
        ("echo welcome", ["found welcome", "--resume"]),
        ("echo 'sbatch: error: Batch job submission failed: Invalid job array specification' >&2; exit 1", ["MaxArraySize", "--runs-a-task"]),
        ("echo 'sbatch: error: invalid partition specified: x' >&2; exit 1", ["invalid partition", "--sbatch=--partition"]),
        ("echo 'sbatch: error: Requested time limit is invalid (missing or exceeds some limit)' >&2; exit 1", ["time limit", "--time"]),
    ]
    .into_iter()
    .enumerate()
    {
        let (code, text) = run(sbatch, &format!("refused-{k}"));
        assert_eq!(code, Some(1), "{text}");
        assert!(expected.iter().all(|e| text.contains(e)), "{text}");
        assert!(!text.contains("tasks submitted"), "{text}");
    }
}

/// Three that go on at one moment submit once: the second looks at the queue after the first has its answer.
#[test]
#[cfg(unix)]
fn three_at_once_submit_an_array_once() {
    let bench = Bench::new(2);
    bench.coupons(1000);
    let path = stubs(
        &bench.place,
        &[
            (
                "sbatch",
                "sleep 1; echo 1 RUNNING >queue; echo 2 PENDING >>queue; echo x >>submissions; echo 17",
            ),
            ("squeue", "cat queue 2>/dev/null; true"),
        ],
    );
    let arguments = [
        "campaign",
        "campaign.json",
        "--engine",
        "slurm",
        "--runs-a-task",
        "1",
        "--out",
        "array",
        "--resume",
    ];
    let all: Vec<Child> = (0..3)
        .map(|_| {
            bench
                .command(&arguments)
                .env("PATH", &path)
                .spawn()
                .unwrap()
        })
        .collect();
    for child in all {
        let end = child.wait_with_output().unwrap();
        assert!(end.status.success(), "{end:?}");
    }
    let submissions = std::fs::read_to_string(bench.place.join("submissions")).unwrap();
    assert_eq!(submissions, "x\n");
    let mut status = bench.command(&["campaign", "status", "array"]);
    let said = status.env("PATH", &path).output().unwrap().stdout;
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("2 tasks wait or run in Slurm"), "{said}");
    assert!(said.contains("mock-coupon-1  waiting"), "{said}");
}

#[test]
fn a_campaign_says_how_it_stands_and_unknown_words_are_named() {
    let bench = Bench::new(2);
    bench.coupons(1000);
    bench.succeed(&["campaign", "campaign.json", "--out", "done"]);
    let before = below(&bench.place);
    let said = bench.succeed(&["campaign", "status", "done"]);
    assert!(
        said.contains("2 runs: 2 done") && said.contains("begun 1 times"),
        "{said}"
    );
    assert!(said.contains("next: plychain campaign collect"), "{said}");
    assert_eq!(below(&bench.place), before);
    std::fs::remove_file(bench.place.join("done/runs/mock-coupon-2/report.html")).unwrap();
    let said = bench.succeed(&["campaign", "status", "done"]);
    assert!(said.contains("mock-coupon-2  to be resumed"), "{said}");
    assert!(said.contains("--resume goes on"), "{said}");
    for words in [&["campaign", "stauts", "done"][..], &["campaign", "stauts"]] {
        let said = bench.refused(words, 1);
        assert!(
            said.contains("found stauts") && said.contains("status, collect"),
            "{said}"
        );
    }
    let said = bench.refused(&["campaign", "status", "bin"], 1);
    assert!(said.contains("no plan.json"), "{said}");
}

#[test]
#[ignore = "needs ../shared"]
#[cfg(unix)]
fn the_files_of_campaign_dry_run_and_slurm_answers() {
    let place = fresh("dry");
    copy(&shared("field-files/campaign-dry-run"), &place);
    let before = below(&place);
    for engine in ["local", "slurm"] {
        let end = plychain_in(
            &place,
            &["campaign", "camp.json", "--dry-run", "--engine", engine],
        );
        assert!(end.status.success(), "{end:?}");
        assert_eq!(below(&place), before);
    }
    let answers = shared("field-files/slurm-answers");
    let read = |name: &str| std::fs::read_to_string(answers.join(name)).unwrap();
    for (name, code, expected) in [
        ("sbatch-banner", 0, "job 4712: "),
        ("sbatch-empty", 1, "nothing counts as submitted"),
        ("sbatch-array", 1, "--runs-a-task"),
    ] {
        let path = stubs(
            &place,
            &[("sbatch", &read(name)), ("squeue", &read("squeue"))],
        );
        let mut command = program();
        let arguments = [
            "campaign",
            "camp.json",
            "-v",
            "--engine",
            "slurm",
            "--out",
            name,
        ];
        let end = command
            .current_dir(&place)
            .args(arguments)
            .env("PATH", path)
            .output()
            .unwrap();
        let text = String::from_utf8([end.stdout, end.stderr].concat()).unwrap();
        assert_eq!(end.status.code(), Some(code), "{text}");
        assert!(text.contains(expected), "{name}: {text}");
    }
    let end = plychain_in(&place, &["campaign", "camp.json", "--quiet"]);
    assert!(end.status.success(), "{end:?}");
}
