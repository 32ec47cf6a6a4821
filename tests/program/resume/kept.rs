//! One process works on a run, and what cannot be written costs nothing that was finished.

use super::*;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A second process is refused as long as the first one lives, whatever end that has.
#[test]
#[ignore = "slow: run by .ci/run"]
#[cfg(target_os = "linux")]
fn one_process_works_on_a_run() {
    let bench = Bench::new();
    let model = model();
    let arguments = identify(&model, "run", &[]);
    let mut first = bench.command(&arguments).spawn().unwrap();
    let begun = bench.path("run/checkpoint");
    while !begun.exists() && first.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let resumed = identify(&model, "run", &["--resume"]);
    let others: Vec<Child> = (0..2)
        .map(|_| bench.command(&resumed).spawn().unwrap())
        .collect();
    for other in others {
        let end = other.wait_with_output().unwrap();
        let said = text(&end.stderr);
        assert_eq!(end.status.code(), Some(1), "{said}");
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        let holder = format!("process {} on {}", first.id(), host.trim());
        assert!(said.contains(&holder), "{said}");
    }
    assert!(
        first.try_wait().unwrap().is_none(),
        "too short to be disturbed"
    );
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(bench.path("run/run.lock").exists());
    let end = bench.run(&resumed);
    assert!(end.status.success(), "{}", text(&end.stderr));
    assert!(!bench.path("run/run.lock").exists());
    let end = bench.run(&identify(&model, "whole", &[]));
    assert!(end.status.success(), "{}", text(&end.stderr));
    assert_same_chains(&bench.path("run"), &bench.path("whole"));
}

/// Chains that are complete stay when the table of their draws finds no room.
#[test]
#[ignore = "slow: run by .ci/run"]
#[cfg(unix)]
fn a_file_too_large_leaves_the_chains_and_resume_goes_on() {
    let bench = Bench::new();
    let model = model();
    let run = |out: &str, limit: Option<u32>, more: &[&str]| {
        let mut all = vec!["identify", &model, "--data", "data", "--csv", "--out", out];
        all.extend(["--min-ess", "1e9", "--max-draws", "200000"]);
        all.extend(more);
        let plain = bench.command(&all);
        let Some(blocks) = limit else {
            return { plain }.output().unwrap();
        };
        let mut shell = Command::new("sh");
        shell
            .args(["-c", &format!("ulimit -f {blocks} && exec \"$0\" \"$@\"")])
            .arg(plain.get_program())
            .args(plain.get_args())
            .current_dir(bench.place.path());
        shell.output().unwrap()
    };
    // the reduced model is kept beside the runs from now on
    let whole = run("whole", None, &[]);
    assert!(whole.status.success(), "{}", text(&whole.stderr));
    let size = |name: &str| std::fs::metadata(bench.path(name)).unwrap().len();
    // between the size of a chunk and that of the table, in whichever blocks the shell counts
    let limit = 5000;
    assert!(size("whole/chain.csv") > limit * 1024);
    let end = run("cut", Some(limit as u32), &[]);
    let said = text(&end.stderr);
    assert_eq!(end.status.code(), Some(1), "{said}");
    assert!(
        said.contains("chain.csv") && said.contains("ulimit -f"),
        "{said}"
    );
    assert!(said.contains("finished files stay in cut"), "{said}");
    let left = std::fs::read_to_string(bench.path("cut/run.json")).unwrap();
    assert!(left.contains("unfinished"), "{left}");
    for name in ["chain.csv", "chain.csv.new", "report.html", "run.lock"] {
        assert!(!bench.path("cut").join(name).exists(), "{name}");
    }
    let end = run("cut", None, &["--resume"]);
    assert!(end.status.success(), "{}", text(&end.stderr));
    assert_same_chains(&bench.path("cut"), &bench.path("whole"));
    // a finished run that is asked for again and finds no room keeps its table
    let before = std::fs::read(bench.path("cut/chain.csv")).unwrap();
    let end = run("cut", Some(limit as u32), &["--resume"]);
    assert_eq!(end.status.code(), Some(1), "{}", text(&end.stderr));
    assert!(std::fs::read(bench.path("cut/chain.csv")).unwrap() == before);
}
