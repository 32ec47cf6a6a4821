//! The runs of a campaign with the hashes of what they read, frozen in `plan.json` of its folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::declared::read;
use super::run::Run;
use super::sweep;
use crate::error::{Error, Result};
use crate::files::{self, Keyed, absolute, parse_json};
use crate::report::manifest::hashes;
use crate::study::Study;

/// The schema of `plan.json`.
pub const SCHEMA: &str = "plychain-campaign-plan/1";

/// `plan.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub schema: String,
    pub name: String,
    pub version: String,
    pub runs: Vec<Run>,
}

impl Plan {
    /// The plan of a campaign file: every model is read, and every input hashed. Models with keys set are written into `folder`.
    ///
    /// # Errors
    /// The input's fault: the campaign file's, a model's, or that of a file that cannot be read.
    pub fn make(file: &Path, folder: &Path, seed: u64) -> Result<Self> {
        let (name, declared) = read(file, seed)?;
        let mut known = BTreeMap::new();
        let plan = |run: Run| {
            let about = format!("{}: run {}", file.display(), run.name);
            planned(run, folder, &mut known).map_err(|e| e.within(about))
        };
        Ok(Self {
            schema: SCHEMA.into(),
            name,
            version: env!("CARGO_PKG_VERSION").into(),
            runs: declared.into_iter().map(plan).collect::<Result<_>>()?,
        })
    }

    /// The plan in a campaign's folder; none if there is none.
    ///
    /// # Errors
    /// The input's fault, with the place.
    pub fn load(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join("plan.json");
        let place = path.display().to_string();
        match std::fs::read_to_string(&path) {
            Ok(text) => parse_json(&text, &place).map(Some),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::input(place, "the plan of a campaign").found(e)),
        }
    }

    /// # Errors
    /// Of the input: a folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        files::write_json(&folder.join("plan.json"), self)
    }

    /// The same plan with what was written into one folder in another.
    #[must_use]
    pub fn moved(mut self, from: &Path, to: &Path) -> Self {
        let path = |path: &Path| {
            let below = path.strip_prefix(from);
            below.map_or_else(|_| path.to_path_buf(), |below| to.join(below))
        };
        for run in &mut self.runs {
            run.model = path(&run.model);
            let inputs = std::mem::take(&mut run.inputs_sha256).into_iter();
            run.inputs_sha256 = inputs
                .map(|(file, hash)| (path(Path::new(&file)).display().to_string(), hash))
                .collect();
        }
        self
    }

    /// Runs of this plan that are not what an earlier plan says, with what differs.
    pub fn changed_since<'a>(&'a self, earlier: &'a Self) -> Vec<(&'a Run, String)> {
        let known: BTreeMap<&str, &Run> =
            earlier.runs.iter().map(|r| (r.name.as_str(), r)).collect();
        let differs = |run: &'a Run| {
            let difference = known.get(run.name.as_str())?.difference(run)?;
            Some((run, difference))
        };
        self.runs.iter().filter_map(differs).collect()
    }
}

/// Hashes by model and data, so that a model of many seeds is read once.
type KnownSettings = BTreeMap<(PathBuf, Option<PathBuf>), Keyed<String>>;

/// The run with absolute paths and the hashes of what it reads; a model with keys set is written into `folder`.
fn planned(mut run: Run, folder: &Path, known: &mut KnownSettings) -> Result<Run> {
    run.model = absolute(&run.model)?;
    if !run.set.is_empty() {
        let changed = sweep::changed(&run.model, &run.set)?;
        let models = folder.join("models");
        run.model = models.join(format!("{}.json", run.name));
        files::make_folder(&models)?;
        files::write_json(&run.model, &changed)?;
    }
    run.data = run.data.as_deref().map(absolute).transpose()?;
    let settings = (run.model.clone(), run.data.clone());
    run.inputs_sha256 = match known.get(&settings) {
        Some(inputs) => inputs.clone(),
        None => {
            let inputs = inputs(&run.model, run.data.as_ref())?;
            known.insert(settings, inputs.clone());
            inputs
        }
    };
    Ok(run)
}

/// SHA-256 of a model file and of the data that it is run with, all checked as far as they are before a run.
fn inputs(path: &PathBuf, data: Option<&PathBuf>) -> Result<Keyed<String>> {
    let files = Study::load_with(path, data)?.files()?;
    hashes(std::iter::once(path).chain(&files))
}
