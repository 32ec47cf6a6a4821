//! Reduced models on disk, by the hash of what determines them.

use std::fs::{File, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::model::ReducedModel;
use super::problem::Problem;
use super::snapshots::{Snapshots, design};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::files::hex;
use crate::progress::Progress;

/// Raised whenever the code changes what a reduced model of the same problem is.
const FORMAT: u32 = 10;

/// What a file of the cache holds below a first line with the SHA-256 of the rest.
#[derive(Serialize, Deserialize)]
struct StoredModel {
    key: String,
    model: ReducedModel,
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
    let path = directory.join(format!("{key}.json"));
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
    let stored = StoredModel { key, model };
    // A cache that cannot be written costs time, not correctness.
    if let Err(e) = write(&path, &stored) {
        progress.say(&format!("not cached ({e})"));
    }
    progress.end();
    Ok((stored.model, false))
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

fn read(path: &PathBuf, key: &str) -> Option<ReducedModel> {
    let bytes = std::fs::read(path).ok()?;
    let (hash, text) = bytes.split_at_checked(64)?;
    if hex(&Sha256::digest(text)).as_bytes() != hash {
        return None;
    }
    let stored: StoredModel = serde_json::from_slice(text).ok()?;
    (stored.key == key && stored.model.is_consistent()).then_some(stored.model)
}

/// Write under another name first, so that a reader never sees half a file.
fn write(path: &Path, stored: &StoredModel) -> Result<()> {
    let fail =
        |e: &dyn std::fmt::Display| Error::unwritable(path.display(), "a writable cache").found(e);
    if let Some(directory) = path.parent() {
        std::fs::create_dir_all(directory).map_err(|e| fail(&e))?;
    }
    let partial = path.with_extension(format!("{}.partial", std::process::id()));
    let mut text = vec![b'\n'];
    serde_json::to_writer(&mut text, stored).map_err(|e| fail(&e))?;
    std::fs::File::create(&partial)
        .and_then(|mut file| {
            file.write_all(hex(&Sha256::digest(&text)).as_bytes())?;
            file.write_all(&text)
        })
        .and_then(|()| std::fs::rename(&partial, path))
        .map_err(|e| {
            // What could not be moved is of no use to anybody.
            let _ = std::fs::remove_file(&partial);
            fail(&e)
        })
}
