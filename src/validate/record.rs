//! Records of replicates: a header that says of what, and one line of JSON each.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};
use crate::files;

/// Share K of N of the replicates, counted from 1: every N-th. It has a record of its own beside the whole one, so that no two processes write
/// one file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    pub task: usize,
    pub of: usize,
}

impl Share {
    pub fn has(self, replicate: usize) -> bool {
        replicate % self.of == self.task - 1
    }

    /// Its record beside that of all.
    fn path(self, whole: &Path) -> PathBuf {
        whole.with_extension(format!("share-{}-of-{}.jsonl", self.task, self.of))
    }
}

/// Records of shares beside that of all, whatever their number.
fn shares(whole: &Path) -> Vec<PathBuf> {
    let stem = whole.file_stem().unwrap_or_default().to_string_lossy();
    let begin = format!("{stem}.share-");
    let folder = whole.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|p| {
            let name = p.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(&begin) && name.ends_with(".jsonl")
        })
        .collect();
    paths.sort();
    paths
}

/// A record that replicates are added to.
pub struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
    /// Open the record of a share, or of all, and read what it and the records beside it hold.
    ///
    /// # Errors
    /// Those of [`Record::open`], of any of them.
    pub fn open_among<T: Serialize + DeserializeOwned>(
        whole: &Path,
        of: &impl Serialize,
        share: Option<Share>,
    ) -> Result<(Self, Vec<T>)> {
        let own = share.map_or_else(|| whole.to_path_buf(), |s| s.path(whole));
        let (record, mut known) = Self::open(&own, of)?;
        let mut beside = shares(whole);
        beside.push(whole.to_path_buf());
        for path in beside.iter().filter(|p| **p != own && p.exists()) {
            known.extend(read(path, &line(of)?)?.unwrap_or_default());
        }
        Ok((record, known))
    }

    /// Read a record, or begin one. A last line that was cut off by a kill is dropped.
    ///
    /// # Errors
    /// A record of something else; a place that cannot be read or written.
    pub fn open<T: Serialize + DeserializeOwned>(
        path: &Path,
        of: &impl Serialize,
    ) -> Result<(Self, Vec<T>)> {
        let failed = |e: std::io::Error| {
            Error::input(path.display(), "a readable and writable file").found(e)
        };
        let header = line(of)?;
        let known: Vec<T> = read(path, &header)?.unwrap_or_default();
        let mut whole = header + "\n";
        for replicate in &known {
            whole += &line(replicate)?;
            whole.push('\n');
        }
        files::replace(path, whole)?;
        let file = OpenOptions::new().append(true).open(path).map_err(failed)?;
        let path = path.to_path_buf();
        Ok((Self { path, file }, known))
    }

    /// Add a replicate.
    ///
    /// # Errors
    /// Of the input: a file that cannot be written.
    pub fn add(&mut self, replicate: &impl Serialize) -> Result<()> {
        let line = line(replicate)? + "\n";
        let written = self.file.write_all(line.as_bytes());
        written.map_err(|e| Error::input(self.path.display(), "a writable file").found(e))
    }
}

/// What a record of the same as `header` says holds; none if there is no record.
fn read<T: DeserializeOwned>(path: &Path, header: &str) -> Result<Option<Vec<T>>> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => {
            return Err(Error::input(path.display(), "a readable and writable file").found(e));
        }
    };
    let mut lines = text.lines();
    if lines.next().is_some_and(|first| first != header) {
        let expected = "a record of the same model, seed, noise and grid";
        return Err(Error::input(path.display(), expected)
            .found("another one")
            .hint("choose another --out; nothing was changed"));
    }
    Ok(Some(
        lines.map_while(|l| serde_json::from_str(l).ok()).collect(),
    ))
}

fn line(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value)
        .map_err(|e| Error::program("calibration", "numbers that JSON can hold").found(e))
}
