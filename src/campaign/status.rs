//! The state of each run, from files of its own: what its folder holds, what was noted when it ended, and a lock that its process holds.
//! No two processes write one file, and the system lets go of a lock in whatever way its holder ends.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::run::Run;
use crate::error::Result;
use crate::files::{self, unwritable};
use crate::report::manifest::Manifest;

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    Waiting,
    Running,
    Done,
    Failed,
    ToBeResumed,
}

impl RunState {
    pub const ALL: [Self; 5] = [
        Self::Waiting,
        Self::Running,
        Self::Done,
        Self::Failed,
        Self::ToBeResumed,
    ];

    pub fn words(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::ToBeResumed => "to be resumed",
        }
    }
}

/// What is noted of a run when it begins and when it ends, `status/NAME.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RunStatus {
    pub state: RunState,
    /// Why it failed, or was not brought to its end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    /// How often it was begun or gone on with.
    pub attempts: usize,
    /// Of the program that ran it last.
    pub version: String,
    /// Of all attempts.
    pub seconds: f64,
}

impl Default for RunStatus {
    fn default() -> Self {
        Self {
            state: RunState::Waiting,
            cause: None,
            attempts: 0,
            version: env!("CARGO_PKG_VERSION").into(),
            seconds: 0.0,
        }
    }
}

/// Places in a campaign's folder.
#[derive(Debug)]
pub struct CampaignPlaces(pub PathBuf);

impl CampaignPlaces {
    /// The folder of a run, as if it had been run alone.
    pub fn run(&self, run: &Run) -> PathBuf {
        self.0.join("runs").join(run.folder())
    }

    /// What a run printed.
    pub fn log(&self, name: &str) -> PathBuf {
        self.0.join("log").join(format!("{name}.txt"))
    }

    pub fn status(&self, name: &str) -> PathBuf {
        self.0.join("status").join(format!("{name}.json"))
    }

    fn lock(&self, name: &str) -> PathBuf {
        self.0.join("status").join(format!("{name}.lock"))
    }

    /// What is noted of a run; what cannot be read is as if it were not there.
    pub fn noted(&self, name: &str) -> RunStatus {
        let text = std::fs::read_to_string(self.status(name)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// # Errors
    /// Of the input: a folder that cannot be written.
    pub fn note(&self, name: &str, status: &RunStatus) -> Result<()> {
        files::write_json(&self.status(name), status)
    }

    /// The state of a run as its files tell it, with what is noted of it. A run whose process is gone without a word is to be resumed.
    pub fn state(&self, run: &Run) -> RunStatus {
        let mut status = self.noted(&run.name);
        status.state = match status.state {
            _ if self.is_finished(run) => RunState::Done,
            _ if self.is_locked(&run.name) => RunState::Running,
            RunState::Failed => RunState::Failed,
            RunState::Waiting if run.share.is_some() || !self.run(run).exists() => {
                RunState::Waiting
            }
            _ => RunState::ToBeResumed,
        };
        if status.state == RunState::Done {
            status.cause = None;
        }
        status
    }

    /// The page is what a field's run writes last, the manifest what a plate's does. A share has neither; to run one again that is
    /// done costs little.
    pub fn is_finished(&self, run: &Run) -> bool {
        if run.share.is_some() {
            return self.noted(&run.name).state == RunState::Done;
        }
        let folder = self.run(run);
        folder.join("report.html").is_file() && Manifest::load(&folder).is_ok()
    }

    fn is_locked(&self, name: &str) -> bool {
        let Ok(file) = File::open(self.lock(name)) else {
            return false;
        };
        // one that looks at the same moment does not keep a run from its lock
        matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
    }

    /// The lock of a run; none if another process holds it.
    ///
    /// # Errors
    /// Of the input: a folder that cannot be written.
    pub fn take(&self, name: &str) -> Result<Option<File>> {
        let path = self.lock(name);
        let file = lock_file(&path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Ok(None),
            // where there are no locks, shares that differ keep processes apart
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Some(file)),
        }
    }

    /// Waits for what only one process may do to the campaign's folder at a time.
    ///
    /// # Errors
    /// Of the input: a folder that cannot be written.
    pub fn alone(&self) -> Result<File> {
        self.held("campaign.lock")
    }

    /// Waits for what only one process may ask of a scheduler at a time; the tasks that it begins meanwhile do not wait for that.
    ///
    /// # Errors
    /// Of the input: a folder that cannot be written.
    pub fn submitting(&self) -> Result<File> {
        self.held("submit.lock")
    }

    fn held(&self, name: &str) -> Result<File> {
        let file = lock_file(&self.0.join(name))?;
        // without locks the last to write wins, and writes the same
        let _ = file.lock();
        Ok(file)
    }
}

fn lock_file(path: &Path) -> Result<File> {
    let file = File::options()
        .read(true)
        .append(true)
        .create(true)
        .open(path);
    file.map_err(|e| unwritable(path, &e))
}
