//! A run folder: made before the work, named so that no run overwrites another, removed again if the work fails before anything of a run is
//! finished.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use serde_json::{Value, json};

use super::RUNS;
use super::console::line;
use super::held::HeldRun;
use crate::error::{Error, Result};
use crate::files::{self, STAGES, not_made};
use crate::infer::Model;
use crate::progress::StageCost;
use crate::report::manifest::{Manifest, hashes};

/// A folder under construction. Dropped without [`Folder::keep`], it is removed, unless it has what a run can be gone on from.
pub struct Folder {
    path: PathBuf,
    started: Instant,
    kept: bool,
    /// Since it was said which run it is.
    held: Option<HeldRun>,
}

impl Folder {
    /// The folder of an interrupted run if there is one to `resume`, or else a new one.
    ///
    /// # Errors
    /// Those of [`Folder::reopen`] and [`Folder::create`].
    pub fn open(out: Option<&Path>, name: &str, resume: bool) -> Result<Self> {
        match out {
            Some(path) if resume && path.exists() => Self::reopen(path),
            _ => Self::create(out, name),
        }
    }

    /// Make the folder of a run: `out` if given, which must not exist, or the first free of `runs/NAME`, `runs/NAME-2`, ...
    pub fn create(out: Option<&Path>, name: &str) -> Result<Self> {
        let Some(path) = out else {
            return Self::first_free(name);
        };
        if path.exists() {
            return Err(Error::input(
                format!("--out {}", path.display()),
                "a folder that does not exist yet",
            )
            .found(if is_unfinished(path) {
                "that of an interrupted run"
            } else {
                "an existing one"
            })
            .hint("give another name, or remove the old one; --resume goes on with a run that was interrupted"));
        }
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| not_made(path, &e))?;
        }
        std::fs::create_dir(path).map_err(|e| not_made(path, &e))?;
        Ok(Self::at(path, false))
    }

    /// The first of `runs/NAME`, `runs/NAME-2`, ... that nobody has, another process that starts at the same time included.
    fn first_free(name: &str) -> Result<Self> {
        let runs = Path::new(RUNS);
        std::fs::create_dir_all(runs).map_err(|e| not_made(runs, &e))?;
        let mut path = runs.join(name);
        let mut number = 1;
        loop {
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(Self::at(&path, false)),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
                    number += 1;
                    path = runs.join(format!("{name}-{number}"));
                }
                Err(e) => return Err(not_made(&path, &e)),
            }
        }
    }

    fn at(path: &Path, kept: bool) -> Self {
        Self {
            path: path.to_path_buf(),
            started: Instant::now(),
            kept,
            held: None,
        }
    }

    /// Whether it was made just now.
    pub fn is_new(&self) -> bool {
        !self.kept
    }

    /// The interrupted run that a new one in the next free folder leaves behind, if there is one.
    pub fn interrupted(&self) -> Option<PathBuf> {
        let name = self.path.file_name()?.to_str()?;
        let (stem, number) = name.rsplit_once('-')?;
        let before = match number.parse::<usize>().ok()? {
            2 => stem.to_string(),
            n => format!("{stem}-{}", n.checked_sub(1)?),
        };
        let path = self.path.with_file_name(before);
        is_unfinished(&path).then_some(path)
    }

    /// The folder of an earlier run, to go on with it. Nothing of it is removed.
    ///
    /// # Errors
    /// The input's fault if it does not exist, or holds files but neither a checkpoint nor a run's manifest.
    pub fn reopen(path: &Path) -> Result<Self> {
        let place = format!("--resume: --out {}", path.display());
        let wanted = || Error::input(&place, "the folder of a run that was interrupted");
        let mut entries = std::fs::read_dir(path).map_err(|e| wanted().found(e))?;
        let ours = ["run.json", "checkpoint"]
            .iter()
            .any(|name| path.join(name).exists());
        let foreign = entries.any(|e| e.is_ok_and(|e| e.file_name() != "run.lock"));
        if !ours && foreign {
            return Err(wanted()
                .found("files that are no run's")
                .hint("choose the run's own folder; nothing was changed"));
        }
        Ok(Self::at(path, true))
    }

    /// A finished run's folder, to add to it.
    ///
    /// # Errors
    /// The input's fault if it holds no finished run.
    pub fn of_run(path: &Path) -> Result<Self> {
        for name in ["run.json", "model.json", "chain.zarr"] {
            if !path.join(name).exists() {
                let of_loop = path.join("model.json").exists()
                    && path
                        .parent()
                        .is_some_and(|run| run.join("run.json").exists());
                let hint = if of_loop {
                    "a later round of a loop has no run of its own: plychain validate takes its model.json, and identifies it first"
                } else {
                    "plychain identify writes one"
                };
                return Err(Error::input(
                    path.display(),
                    "the folder of a finished run, or a model file",
                )
                .found(format!("no {name} in it"))
                .hint(hint));
            }
        }
        Ok(Self::at(path, true))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Hold the folder, and write what the run is, unless it says so already.
    ///
    /// # Errors
    /// The input's fault if the folder is of another run, or another process works on it.
    pub fn begin(&mut self, identity: &Value) -> Result<()> {
        let held = HeldRun::take(&self.path);
        // what another process works on is not for this one to remove
        self.kept |= held.is_err();
        self.held = Some(held?);
        let path = self.path.join("run.json");
        let Ok(text) = std::fs::read_to_string(&path) else {
            return self.write_json(
                "run.json",
                &json!({ "program": "plychain", "unfinished": identity }),
            );
        };
        let known: Value = serde_json::from_str(&text)
            .map_err(|e| Error::input(path.display(), "the manifest of a run").found(e))?;
        let wanted = |expected: String| {
            Error::input(path.display(), expected)
                .hint("this folder belongs to another run; nothing was changed")
        };
        if let Some(theirs) = known.get("unfinished") {
            let keys = identity.as_object().into_iter().flatten();
            let differing: Vec<String> = keys
                .filter(|(key, value)| theirs.get(key) != Some(value))
                .map(|(key, _)| key.clone())
                .collect();
            return match differing.is_empty() {
                true => Ok(()),
                false => Err(wanted("the run that was interrupted".into())
                    .found(format!("another {}", differing.join(", ")))),
            };
        }
        // a finished run may be asked for again, and by the same verb only: another would write over what it left
        let command = known["command"].as_array().into_iter().flatten();
        let theirs = verb(command.filter_map(Value::as_str));
        match (identity["verb"].as_str(), theirs) {
            (Some(own), Some(theirs)) if own != theirs => {
                Err(wanted(format!("a run of {own}")).found(format!("a finished run of {theirs}")))
            }
            _ => Ok(()),
        }
    }

    /// Write a JSON file of the folder.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        files::write_json(&self.path.join(name), value)
    }

    /// The manifest of a run over a model's file, if it has one, and the files it read, with what its stages cost. A run writes it last.
    pub fn manifest(
        &self,
        model: Option<&PathBuf>,
        files: &[PathBuf],
        seed: u64,
        stages: Vec<StageCost>,
    ) -> Result<Manifest> {
        Ok(Manifest {
            program: "plychain".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            command: std::env::args().skip(1).collect(),
            seed,
            inputs_sha256: hashes(model.into_iter().chain(files))?,
            seconds: self.started.elapsed().as_secs_f64(),
            stages,
        })
    }

    /// Whether there is something of a run in it that can be gone on from.
    fn has_finished(&self) -> bool {
        let is_there = |entry: std::fs::DirEntry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            name == "checkpoint" || name == STAGES || name == AVERAGED || name.starts_with("round-")
        };
        let entries = std::fs::read_dir(&self.path).into_iter().flatten();
        self.held.is_some() && entries.flatten().any(is_there)
    }

    /// The folder is complete: it stays, without the stages that a run is gone on from.
    pub fn keep(mut self) {
        remove_stages(&self.path);
        self.kept = true;
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.kept && self.has_finished() {
            let path = self.path.display();
            line(&format!(
                "finished files stay in {path}. To go on, repeat the command with --out {path} --resume"
            ));
        } else if !self.kept {
            // Nothing half-written stays; if removing fails too there is no better place to say so than the error
            // that is already on its way.
            let _ = std::fs::remove_dir_all(&self.path);
        }
    }
}

/// Remove finished stages, of which all files of a run are made by now. What cannot be removed only takes room.
fn remove_stages(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for path in entries.map(|e| e.path()).filter(|path| path.is_dir()) {
        match path.file_name().is_some_and(|name| name == STAGES) {
            true => drop(std::fs::remove_dir_all(&path)),
            false if path.extension().is_none() => remove_stages(&path),
            false => {}
        }
    }
}

/// The verb among the arguments of a run that has a folder.
pub fn verb<'a>(mut arguments: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    const VERBS: [&str; 4] = ["identify", "loop", "sample", "validate"];
    arguments.find(|a| VERBS.contains(a))
}

/// Whether a folder is that of a run that was interrupted: its page is what it writes last.
fn is_unfinished(path: &Path) -> bool {
    let text = std::fs::read_to_string(path.join("run.json")).unwrap_or_default();
    let known: Value = serde_json::from_str(&text).unwrap_or_default();
    let command = known["command"].as_array().into_iter().flatten();
    let has_page = verb(command.filter_map(Value::as_str)) != Some("sample");
    known.get("unfinished").is_some()
        || (has_page && path.join("checkpoint").exists() && !path.join("report.html").exists())
}

/// The folder of the posterior to quote in a loop's.
pub const AVERAGED: &str = "averaged";

/// Attempts at rounds that a loop may have made.
const MOST_ATTEMPTS: usize = 100;

/// Says which of a loop's chains are taken, and where the others are.
pub fn say_round(folder: &Path) {
    let attempt = |k: usize| folder.join(format!("round-{k}"));
    // an attempt that was taken back has no model.json
    let stayed = |k: &usize| attempt(*k).join("model.json").is_file();
    if let Some(last) = (1..MOST_ATTEMPTS).rev().find(stayed) {
        line(&format!(
            "  {} is of a loop. The draws of its last round are in {}.",
            folder.display(),
            attempt(last).display()
        ));
    }
    if folder.join(AVERAGED).is_dir() {
        line(&format!(
            "  These are the draws of the averaged posterior. Those of the model as it was given are in {}.",
            folder.join("chain.zarr").display()
        ));
    }
}

/// A run's folder must be of a finished run, and the model's measurement what that run read. A run of another version is
/// taken as it is, and said to be one.
///
/// # Errors
/// The input's fault, with the file.
pub fn check_run(folder: &Path, model: &Model) -> Result<()> {
    let manifest = Manifest::load(folder)?;
    for (name, hash) in hashes(model.measurement_files()?.iter())? {
        if !manifest.inputs_sha256.values().any(|known| *known == hash) {
            return Err(Error::input(name, "the measurement that the run read")
                .found("a file that changed since")
                .hint("identify it anew"));
        }
    }
    if manifest.version != env!("CARGO_PKG_VERSION") {
        line(&format!(
            "  {} was written by version {}, this is {}",
            folder.display(),
            manifest.version,
            env!("CARGO_PKG_VERSION")
        ));
    }
    Ok(())
}
