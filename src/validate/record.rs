//! Records of replicates: a header that says of what, and one line of JSON each.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};
use crate::files;

/// A record that replicates are added to.
pub struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
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
        let text = if path.exists() {
            std::fs::read_to_string(path).map_err(failed)?
        } else {
            String::new()
        };
        let mut lines = text.lines();
        if lines.next().is_some_and(|first| first != header) {
            let expected = "a record of the same model, seed, noise and grid";
            return Err(Error::input(path.display(), expected)
                .found("another one")
                .hint("choose another --out; nothing was changed"));
        }
        let known: Vec<T> = lines.map_while(|l| serde_json::from_str(l).ok()).collect();
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

fn line(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value)
        .map_err(|e| Error::program("calibration", "numbers that JSON can hold").found(e))
}
