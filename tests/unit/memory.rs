//! A run of any length takes little memory: draws go to disk as they come.

use std::process::Command;

use plychain::chain::StoreReader;
use plychain::diagnose::{Rule, diagnose};
use plychain::sample::{Ensemble, Keeping, Quiet, Regime, Schedule, Start, run_kept};

use crate::targets;

/// Names the number of draws to the process whose memory is measured.
const DRAWS: &str = "PLYCHAIN_TEST_DRAWS";

/// Largest resident memory of this process so far, MiB.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    let kib: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    kib / 1024.0
}

/// The process that is measured: five parameters, everything stored, then diagnosed again from the store.
#[test]
#[ignore = "started by the tests below in a process of its own, seconds"]
fn measured() {
    let draws = std::env::var(DRAWS).unwrap_or_else(|_| "100000".into());
    let place = tempfile::tempdir().unwrap();
    let target = targets::correlated(5, 100.0);
    let covariance = target.diagonal();
    let start = Start::Ball {
        centre: &target.mean,
        covariance: &covariance,
        spread: 1.0,
    };
    let schedule = Schedule {
        max_draws: draws.parse().unwrap(),
        thin: Some(1),
        ..Schedule::default()
    };
    let never = Rule {
        ess: f64::INFINITY,
        ..Rule::default()
    };
    let keeping = Keeping {
        store: place.path().join("chain.zarr"),
        checkpoint: place.path().join("checkpoint"),
        identity: serde_json::json!({}),
        resume: false,
        observed: Vec::new(),
    };
    let sampler = Ensemble::default();
    let regime = Regime {
        schedule: &schedule,
        stop: &never,
        monitor: &Quiet,
    };
    let outcome = run_kept(&target, &sampler, &start, &regime, Some(&keeping)).unwrap();
    let reader = StoreReader::open(&keeping.store).unwrap();
    assert_eq!(
        reader.draws * reader.ensemble().len(),
        schedule.max_draws / 256 * 256
    );
    let held = outcome.draws.len();
    drop(outcome);
    let thinned = reader.thinned(schedule.memory).unwrap();
    assert!(held <= schedule.memory && thinned.len() <= schedule.memory);
    assert!(diagnose(&thinned, &Rule::default()).converged);
    // Going on reads the whole store again.
    let again = Keeping {
        resume: true,
        ..keeping
    };
    run_kept(&target, &sampler, &start, &regime, Some(&again)).unwrap();
    println!("peak {} MiB", peak());
}

fn measure(draws: usize) {
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["memory::measured", "--exact", "--ignored", "--nocapture"])
        .env(DRAWS, draws.to_string())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{output:?}");
    let peak = text.split("peak ").nth(1).unwrap();
    let peak: f64 = peak.split(' ').next().unwrap().parse().unwrap();
    assert!(peak < 200.0, "{peak} MiB");
}

/// Two million draws of six numbers would be 92 MiB, and their diagnostics several times that.
#[test]
#[ignore = "slow: run by .ci/run"]
fn two_million_draws_take_less_than_200_mib() {
    measure(2_000_000);
}

#[test]
#[ignore = "half a gigabyte on disk, 1 minute"]
fn ten_million_draws_take_less_than_200_mib() {
    measure(10_000_000);
}
