//! The models that come with the program, with their data: written where somebody asks for them, and in an empty folder.

use std::path::{Path, PathBuf};

use super::console::line;
use super::{Command, DEFAULT_MODEL, Global};
use crate::error::{Error, Result};
use crate::files;

/// A model with the files that it reads, by their paths beside it.
pub(super) struct Example {
    pub name: &'static str,
    model: &'static str,
    data: &'static [(&'static str, &'static [u8])],
}

/// A file below `models`, with its path there.
macro_rules! file {
    ($($part:literal),*) => {
        (concat!($($part),*), include_bytes!(concat!("../../models/", $($part),*)))
    };
}

/// An example by its name, with the matrices of a field in a folder and with other files.
macro_rules! example {
    ($name:literal $(, matrices in $folder:literal)? $(, $file:literal)*) => {
        Example {
            name: $name,
            model: include_str!(concat!("../../models/", $name, ".json")),
            data: &[
                $(
                    file!($folder, "/X.txt"),
                    file!($folder, "/Y.txt"),
                    file!($folder, "/U.txt"),
                    file!($folder, "/V.txt"),
                )?
                $(file!($file)),*
            ],
        }
    };
}

pub(super) const EXAMPLES: &[Example] = &[
    example!("openhole", matrices in "openhole", "openhole/truth.json"),
    example!("plate"),
    example!("openhole-and-plate", matrices in "openhole-and-plate", "openhole-and-plate/truth.json"),
    example!("two-holes", matrices in "two-holes", "two-holes/truth.json", "two-holes/two-holes.msh"),
    example!("oblique", matrices in "oblique", "oblique/truth.json", "oblique/oblique.msh"),
    example!("iosipescu", matrices in "iosipescu", "iosipescu/truth.json", "iosipescu/iosipescu.msh"),
    example!("disc", matrices in "disc", "disc/truth.json", "disc/disc.msh"),
    example!("steel-s235"),
    example!("openhole-calculix", matrices in "openhole", "calculix/solve.py"),
];

/// The example of a name.
///
/// # Errors
/// The input's fault: a name that no example has.
pub(super) fn find(name: &str) -> Result<&'static Example> {
    let found = EXAMPLES.iter().find(|e| e.name == name);
    found.ok_or_else(|| Error::one_of("--example", EXAMPLES.iter().map(|e| e.name), name))
}

impl Example {
    /// Write the model and its data into a folder, over nothing that is there, and return the model's path.
    ///
    /// # Errors
    /// The input's fault: a file that exists with other content, a folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(format!("{}.json", self.name));
        let model = (path.clone(), self.model.as_bytes());
        let data = self
            .data
            .iter()
            .map(|(file, bytes)| (folder.join(file), *bytes));
        let all: Vec<(PathBuf, &[u8])> = std::iter::once(model).chain(data).collect();
        for (file, bytes) in &all {
            if std::fs::read(file).is_ok_and(|there| there != *bytes) {
                return Err(
                    Error::input(file.display(), "a file that does not exist yet")
                        .found("an existing one")
                        .hint("go to another folder, or rename the file"),
                );
            }
        }
        for (file, bytes) in &all {
            files::make_folder(file.parent().unwrap_or(Path::new("")))?;
            files::replace(file, bytes)?;
        }
        Ok(path)
    }

    /// What was written, in words.
    pub fn said(&self, path: &Path) -> String {
        let beside: Vec<&str> = self.data.iter().map(|(file, _)| *file).collect();
        let data = match beside.is_empty() {
            true => String::new(),
            false => format!(", with {}", beside.join(", ")),
        };
        format!("{} written{data}\n", path.display())
    }
}

/// Write the default model where a verb is to read it and it is not there: in a folder that is no clone of the repository.
///
/// # Errors
/// Those of [`Example::write`].
pub(super) fn supply_default(verb: &Command, global: &Global) -> Result<()> {
    let path = Path::new(DEFAULT_MODEL);
    if verb.model() != Some(path) || path.exists() {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let written = find("openhole")?.write(folder)?;
    if !global.quiet {
        line(&format!(
            "{}: the example that comes with the program, with its data",
            written.display()
        ));
    }
    Ok(())
}
