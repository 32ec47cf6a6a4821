//! What the three binaries of tests share: a folder of their own, changed models, the program, pictures.
#![allow(dead_code)] // each binary needs some of it

pub mod article;
pub mod pictures;
pub mod tabulated;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Once, OnceLock};

use plychain::identify::{InverseProblem, inverse_problem, prepare};
use plychain::infer::Model;
use plychain::progress::Silent;
use serde_json::Value;

/// The repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where tests run.
pub fn workplace() -> PathBuf {
    static CLEANED: Once = Once::new();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("workplace");
    std::fs::create_dir_all(&path).unwrap();
    CLEANED.call_once(|| remove_what_earlier_runs_left(&path));
    path
}

/// Removes the folders of processes that have ended, where the system lists processes: a run of the tests leaves gigabytes.
fn remove_what_earlier_runs_left(workplace: &Path) {
    let processes = Path::new("/proc");
    if !processes.join(std::process::id().to_string()).exists() {
        return;
    }
    for entry in std::fs::read_dir(workplace).unwrap().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let process = name.split('-').next().unwrap_or_default();
        if process.parse::<u32>().is_ok() && !processes.join(process).exists() {
            // another run of the tests may be removing it too
            std::fs::remove_dir_all(entry.path()).unwrap_or_default();
        }
    }
}

/// A path that does not exist yet, in a folder that does.
pub fn fresh(name: &str) -> PathBuf {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let unique = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = workplace().join(format!("{}-{unique}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Copies a folder with all that is in it.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
        }
    }
}

/// Run `plychain` with some arguments in the workplace.
pub fn plychain(arguments: &[&str]) -> Output {
    plychain_in(&workplace(), arguments)
}

/// The program, to be given arguments; it reads nothing unless it is given something.
pub fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_plychain"));
    command.stdin(std::process::Stdio::null());
    command
}

/// Run `plychain` with some arguments in a folder.
pub fn plychain_in(folder: &Path, arguments: &[&str]) -> Output {
    program()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

/// Run it and expect success.
pub fn succeed(arguments: &[&str]) -> String {
    let output = plychain(arguments);
    let text = String::from_utf8(output.stdout).unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}\n{text}\n{errors}");
    text
}

/// Run, expect exit code 1 and one line of an error with all of `words`.
pub fn refused(arguments: &[&str], words: &[&str]) {
    let output = plychain(arguments);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}\n{errors}");
    let line = errors.lines().find(|l| l.starts_with("error: ")).unwrap();
    for word in words {
        assert!(line.contains(word), "{word:?} is missing in\n{errors}");
    }
}

/// The posterior of the default test on a coarse mesh, made once.
pub fn inverse() -> &'static InverseProblem {
    static MADE: OnceLock<InverseProblem> = OnceLock::new();
    MADE.get_or_init(|| {
        let model = Model::load(coarse().as_ref()).unwrap();
        let prepared = prepare(&model, &Silent).unwrap();
        inverse_problem(&model, prepared, &Silent).unwrap()
    })
}

/// The folder of what `simulate` makes of a model with these arguments.
pub fn simulated(model: &str, arguments: &str) -> PathBuf {
    let out = fresh("simulated");
    let mut all = vec!["simulate", model, "--out", out.to_str().unwrap()];
    all.extend(arguments.split_whitespace());
    succeed(&all);
    out
}

/// A model file of the repository.
pub fn model(name: &str) -> String {
    root().join("models").join(name).display().to_string()
}

/// A model file of the repository, changed; its measurement stays where it is.
pub fn changed(name: &str, change: impl Fn(&mut Value)) -> String {
    let text = std::fs::read_to_string(model(name)).unwrap();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    if let Some(dir) = value["experiments"][0]["measurement"].get_mut("dir") {
        let folder = root().join("models").join(dir.as_str().unwrap());
        *dir = folder.display().to_string().into();
    }
    if let Some(file) = value["experiments"][0]
        .get_mut("mesh")
        .and_then(|m| m.get_mut("file"))
    {
        let mesh = root().join("models").join(file.as_str().unwrap());
        *file = mesh.display().to_string().into();
    }
    change(&mut value);
    let file = fresh("changed.json");
    std::fs::write(&file, value.to_string()).unwrap();
    file.display().to_string()
}

/// The default model on a coarse mesh, for what does not depend on the mesh.
pub fn coarse() -> String {
    static FILE: OnceLock<String> = OnceLock::new();
    FILE.get_or_init(|| changed("openhole.json", set_coarse))
        .clone()
}

/// A third of the elements along each direction: a solution costs a tenth.
pub fn set_coarse(model: &mut Value) {
    model["experiments"][0]["mesh_density"] = 0.3.into();
}

/// Identify and return the first round of `report.json`.
pub fn identify(model: &str, extra: &[&str]) -> Value {
    let out = fresh("run");
    let mut arguments = vec!["identify", model, "--quiet", "--out", out.to_str().unwrap()];
    arguments.extend(extra);
    succeed(&arguments);
    let text = std::fs::read_to_string(out.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["schema"], "plychain-report/1");
    report["rounds"][0].clone()
}

/// Mean and sd of a parameter, or of an effect's amplitude.
pub fn posterior(round: &Value, name: &str) -> (f64, f64) {
    let sampled = Some(&round["posterior"][name]).filter(|p| !p.is_null());
    let p = sampled.unwrap_or(&round["effect_amplitudes"][name]);
    (p["mean"].as_f64().unwrap(), p["sd"].as_f64().unwrap())
}

/// A file or folder of `../shared/data`; for tests that are ignored because they need it.
pub fn shared(name: &str) -> PathBuf {
    root().join("../shared/data").join(name)
}

/// A Python with NumPy, ArviZ, xarray, Zarr, GetDist, pandas and Matplotlib; for tests that are ignored because they need it.
pub fn python() -> std::process::Command {
    let named = std::env::var("PLYCHAIN_PYTHON");
    std::process::Command::new(named.unwrap_or_else(|_| "python3".into()))
}

pub fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

pub fn json(path: &Path) -> Value {
    serde_json::from_str(&read(path)).unwrap()
}

/// The cells of the rows of a page's table that has `heading` in its first line, by their first cell.
pub fn table(page: &str, heading: &str) -> Vec<Vec<String>> {
    let lines = page.lines().skip_while(|line| !line.contains(heading));
    let rows: Vec<Vec<String>> = lines
        .take_while(|line| line.starts_with('|'))
        .skip(2)
        .map(|line| {
            line.trim_matches('|')
                .split('|')
                .map(|c| c.replace("**", "").trim().to_string())
                .collect()
        })
        .collect();
    assert!(!rows.is_empty(), "no table with {heading}");
    rows
}
