//! Reduced models on disk, by the hash of what determines them.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::model::ReducedModel;
use super::problem::Problem;
use super::snapshots::{Snapshots, design};
use crate::error::Result;
use crate::experiment::State;
use crate::files::{self, hex};
use crate::progress::Progress;

/// Raised whenever the code changes what a reduced model of the same problem is.
const FORMAT: u32 = 11;

/// How the file of a key begins.
fn format(key: &str) -> String {
    format!("plychain-reduced/{FORMAT} {key}")
}

/// Hash of everything that determines a reduced model (hexadecimal SHA-256).
pub fn key(problem: &Problem) -> String {
    let text = serde_json::json!([
        FORMAT,
        env!("CARGO_PKG_VERSION"),
        problem.experiment.serialisation(),
        problem.dimensions,
        // that of predictions over supplied snapshots is not in the file
        problem.spec.count(),
        problem.spec,
    ]);
    hex(&Sha256::digest(text.to_string()))
}

/// The reduced model of a problem: from `directory` if it is there, solved and stored there otherwise. Returns
/// whether it was there. A stored model that cannot be read is solved anew.
pub fn obtain(
    problem: &Problem,
    directory: &Path,
    progress: &dyn Progress,
) -> Result<(ReducedModel, bool)> {
    let key = key(problem);
    let path = directory.join(&key);
    let given = problem.given();
    let design = given.map_or_else(|| design(problem), |given| given.rows.to_vec());
    let states: Vec<State> = design.iter().map(|point| problem.state(point)).collect();
    progress.begin("reduced basis of the finite elements", None);
    problem.experiment.span(&states)?;
    progress.end();
    if let Some(model) = read(&path, &key) {
        progress.begin("reduced model found in the cache, nothing to solve", None);
        progress.end();
        return Ok((model, true));
    }
    let lock = Lock::of(&path, progress);
    // what another process built meanwhile
    if let Some(model) = lock.as_ref().and_then(|_| read(&path, &key)) {
        return Ok((model, true));
    }
    progress.begin("finite-element snapshots", Some(design.len() as u64));
    let snapshots = match given {
        Some(given) => Snapshots::of(problem, design, given.fields),
        None => Snapshots::at(problem, design, &|| progress.step())?,
    };
    progress.end();
    progress.begin("modes and response surfaces", None);
    let model = ReducedModel::build(problem, &snapshots)?;
    // A cache that cannot be written costs time, not correctness.
    if let Err(e) = write(&path, &key, &model) {
        progress.say(&format!("not cached ({e})"));
    }
    progress.end();
    Ok((model, false))
}

/// Held while a reduced model is built, so that of several processes one builds it and the others wait. The system lets go of
/// it when its process ends, in whatever way.
struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    /// Waits for it; none where there are no locks, and then the model is built by each.
    fn of(path: &Path, progress: &dyn Progress) -> Option<Self> {
        let path = path.with_extension("lock");
        std::fs::create_dir_all(path.parent()?).ok()?;
        let file = File::create(&path).ok()?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            progress.begin("another process builds the same reduced model", None);
            let locked = file.lock();
            progress.end();
            locked.ok()?;
        }
        Some(Self { path, _file: file })
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Whoever waits for it holds a file without a name then, and finds the model that was built.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn read(path: &Path, key: &str) -> Option<ReducedModel> {
    files::unsealed(&format(key), &std::fs::read(path).ok()?)
}

fn write(path: &Path, key: &str, model: &ReducedModel) -> Result<()> {
    if let Some(directory) = path.parent() {
        files::make_folder(directory)?;
    }
    files::replace(path, files::sealed(&format(key), model)?)
}
