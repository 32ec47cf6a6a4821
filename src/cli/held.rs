//! One run folder, one process: a lock that says who holds it, and that a dead process does not leave behind.
//!
//! The system lets go of its lock in whatever way the holder ends. Where a network file system keeps such locks to one machine, or has
//! none, the holder's file tells: as long as its process lives, its time is renewed.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::files::unwritable;

/// The file in the run's folder.
const NAME: &str = "run.lock";

/// Between two renewals of the file's time, and how long one is waited for.
const BEAT: Duration = Duration::from_secs(5);
const SILENCE: Duration = Duration::from_secs(16);

/// Who holds a run.
#[derive(Debug, Serialize, Deserialize)]
struct Holder {
    process: u32,
    host: String,
    /// Seconds since 1970.
    start: u64,
}

/// The lock of a run; it ends with this.
pub struct HeldRun {
    path: PathBuf,
    /// Given up with the last one who has it.
    _file: Arc<File>,
}

impl HeldRun {
    /// Take the lock of a run's folder.
    ///
    /// # Errors
    /// Of the input: another process that holds it, who is named; a folder that cannot be written.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        loop {
            let mut file = File::options()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(|e| unwritable(&path, &e))?;
            let locked = file.try_lock();
            let holder = holder(&mut file);
            match locked {
                Err(TryLockError::WouldBlock) => return Err(held(folder, holder.as_ref())),
                // its last holder took it away between the two calls
                Ok(()) if !is_at(&file, &path) => continue,
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            let elsewhere = locked.is_err() || holder.as_ref().is_some_and(|h| h.host != host());
            if let Some(holder) = holder.filter(|h| elsewhere && h.may_live() && beats(&path)) {
                return Err(held(folder, Some(&holder)));
            }
            // without room for it the lock holds as well, and says less
            let _ = Holder::own().write(&mut file);
            let file = Arc::new(file);
            let beating = Arc::downgrade(&file);
            std::thread::spawn(move || beat(&beating));
            return Ok(Self { path, _file: file });
        }
    }
}

impl Drop for HeldRun {
    fn drop(&mut self) {
        // what stays is taken by whoever comes next
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Holder {
    fn own() -> Self {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        Self {
            process: std::process::id(),
            host: host(),
            start: now.map_or(0, |t| t.as_secs()),
        }
    }

    fn write(&self, file: &mut File) -> std::io::Result<()> {
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(serde_json::to_string(self)?.as_bytes())
    }

    /// Whether its process is not known to be dead.
    fn may_live(&self) -> bool {
        let processes = Path::new("/proc");
        self.host != host()
            || !processes.join("self").exists()
            || processes.join(self.process.to_string()).exists()
    }
}

fn holder(file: &mut File) -> Option<Holder> {
    let mut text = String::new();
    file.take(1 << 12).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

fn host() -> String {
    let known = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let known = known.or_else(|| std::env::var("HOSTNAME").ok());
    known.map_or_else(|| "this machine".into(), |name| name.trim().into())
}

/// Whether a file is the one that has this name now.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = file.metadata().ok().zip(std::fs::metadata(path).ok());
    same.is_some_and(|(a, b)| (a.dev(), a.ino()) == (b.dev(), b.ino()))
}

#[cfg(not(unix))]
fn is_at(_file: &File, path: &Path) -> bool {
    path.exists()
}

/// Renew the file's time as long as somebody has it.
fn beat(file: &Weak<File>) {
    while let Some(file) = file.upgrade() {
        // a file system that is full or gone is found by what writes to it
        let _ = file.set_modified(SystemTime::now());
        drop(file);
        std::thread::sleep(BEAT);
    }
}

/// Whether the time of a file is renewed; it is opened anew at each look, which network file systems answer from the server.
fn beats(path: &Path) -> bool {
    let time = || File::open(path).and_then(|f| f.metadata()?.modified()).ok();
    let first = time();
    let began = std::time::Instant::now();
    while began.elapsed() < SILENCE {
        std::thread::sleep(Duration::from_millis(500));
        if time() != first {
            return true;
        }
    }
    false
}

fn held(folder: &Path, holder: Option<&Holder>) -> Error {
    let who = holder.map_or_else(
        || "another process".into(),
        |Holder {
             process,
             host,
             start,
         }| {
            let now = Holder::own().start.saturating_sub(*start);
            format!("process {process} on {host}, begun {now} s ago")
        },
    );
    Error::input(
        format!("--out {}", folder.display()),
        "a run that no other process works on",
    )
    .found(who)
    .hint("wait for its end, stop it (SIGTERM), or choose another folder")
}
