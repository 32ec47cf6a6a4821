//! Every write of a run fails once, as on a disk that is full at that moment: what was finished stays, and the run goes on to the same bits.

use super::*;

/// A library that lets the n-th write into files below a folder fail: the system's own call otherwise.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
static long count = 0;
ssize_t write(int fd, const void *bytes, size_t size) {
    static ssize_t (*own)(int, const void *, size_t) = 0;
    if (!own) own = dlsym(RTLD_NEXT, "write");
    const char *below = getenv("FAULT_BELOW"), *at = getenv("FAULT_AT");
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length > 0 && below && at) {
        path[length] = 0;
        if (strstr(path, below) && __sync_add_and_fetch(&count, 1) == atol(at)) {
            errno = ENOSPC;
            return -1;
        }
    }
    return own(fd, bytes, size);
}
"#;

/// The library, if there is a compiler.
pub fn shim(place: &Path) -> Option<PathBuf> {
    let (source, library) = (place.join("shim.c"), place.join("shim.so"));
    std::fs::write(&source, SHIM).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]);
    let built = compiler.arg(&library).arg(&source).arg("-ldl").status();
    built.is_ok_and(|s| s.success()).then_some(library)
}

fn short<'a>(model: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["identify", model, "--data", "data", "--out", out];
    all.extend(["--min-ess", "1e9", "--max-draws", "30000"]);
    all.extend(more);
    all
}

fn faulty(places: impl Iterator<Item = usize>) {
    let bench = Bench::new();
    let library = shim(bench.place.path()).expect("a C compiler, which Rust links with too");
    let model = model();
    let whole = bench.run(&short(&model, "whole", &[]));
    assert!(whole.status.success(), "{whole:?}");
    let (mut failed, mut passed) = (0, 0);
    for at in places {
        let out = bench.path("run");
        let _ = std::fs::remove_dir_all(&out);
        let mut command = bench.command(&short(&model, "run", &[]));
        command.env("LD_PRELOAD", &library);
        command.env("FAULT_BELOW", format!("{}/", out.display()));
        command.env("FAULT_AT", at.to_string());
        let end = command.output().unwrap();
        let said = String::from_utf8_lossy(&end.stderr).into_owned();
        if end.status.success() {
            // more writes than the run has, or one that only takes room
            passed += 1;
        } else {
            failed += 1;
            assert_eq!(end.status.code(), Some(1), "write {at}: {said}");
            assert!(
                said.contains("the disk is full") || said.contains("No space left"),
                "write {at}: {said}"
            );
            let half = |path: &Path| path.extension().is_some_and(|e| e == "new");
            let left = if out.exists() {
                contents(&out)
            } else {
                Vec::new()
            };
            assert!(!left.iter().any(|(p, _)| half(p)), "write {at}");
            let again = bench.run(&short(&model, "run", &["--resume"]));
            let said = String::from_utf8_lossy(&again.stderr).into_owned();
            assert!(again.status.success(), "write {at}: {said}");
        }
        assert_same_chains(&bench.path("whole"), &out);
    }
    println!("{failed} failed, {passed} passed");
    assert!(failed > 3, "{failed} failed, {passed} passed");
}

#[test]
#[ignore = "slow: run by .ci/run"]
#[cfg(target_os = "linux")]
fn a_write_that_fails_costs_nothing_that_was_finished() {
    faulty([1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233].into_iter());
}

#[test]
#[cfg(target_os = "linux")]
#[ignore = "length: every write of a run, 20 minutes"]
fn every_write_of_a_run_may_fail() {
    faulty(1..=400);
}
