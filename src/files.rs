//! Files written in one step, and JSON read with errors that name file, line and key.

mod kept;
mod natural;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use indexmap::IndexMap;
use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};

pub use kept::{KeptStages, STAGES, sealed, to_bytes, unsealed};
pub use natural::natural;

/// A JSON object of entries by name, in their order.
pub type Keyed<T> = IndexMap<String, T>;

/// Write a file beside its place and move it there, so that neither a kill nor a reader at the same time finds half of it.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn replace(path: &Path, contents: impl AsRef<[u8]>) -> Result<()> {
    replace_with(path, |out| out.write_all(contents.as_ref()))
}

/// The same of a file that is written piece by piece.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn replace_with(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    replace_by(path, |beside| {
        let mut out = BufWriter::new(File::create(beside)?);
        write(&mut out)?;
        out.flush()
    })
}

/// The same of a file that is written at the path that it is given.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn replace_by(path: &Path, write: impl FnOnce(&Path) -> std::io::Result<()>) -> Result<()> {
    let beside = beside(path);
    let written = write(&beside).and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|e| {
        // half a file is of no use, and takes room
        let _ = std::fs::remove_file(&beside);
        unwritable(path, &e)
    })
}

/// Write several files that belong together, each of which `write` adds to the list: of an error none of them stays.
///
/// # Errors
/// Those of `write`.
pub fn all_or_none(write: impl FnOnce(&mut Vec<PathBuf>) -> Result<()>) -> Result<()> {
    let mut written = Vec::new();
    write(&mut written).inspect_err(|_| {
        // the error that led here is what counts
        written
            .iter()
            .for_each(|path| drop(std::fs::remove_file(path)));
    })
}

/// Write a folder beside its place and move it there. What was there stays until the new one is complete.
///
/// # Errors
/// The input's fault if it cannot be written, and those of `write`.
pub fn replace_folder(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let beside = beside(path);
    let clear = |path: &Path| match std::fs::remove_dir_all(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(unwritable(path, &e)),
        _ => Ok(()),
    };
    clear(&beside)?;
    write(&beside).inspect_err(|_| {
        // the error that led here is what counts
        let _ = clear(&beside);
    })?;
    clear(path)?;
    std::fs::rename(&beside, path).map_err(|e| unwritable(path, &e))
}

/// Where what replaces a file or a folder is written.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    name.into()
}

/// The error of a file that cannot be written while a run is under way, with what to do.
pub fn unwritable(path: &Path, error: &std::io::Error) -> Error {
    not_written(
        path,
        error,
        "a file that can be written",
        "; a run goes on with --resume",
    )
}

/// The error of a folder that cannot be made, with what to do.
pub fn not_made(path: &Path, error: &std::io::Error) -> Error {
    not_written(path, error, "a place that can be written", "")
}

fn not_written(path: &Path, error: &std::io::Error, expected: &str, then: &str) -> Error {
    let hint = match error.kind() {
        ErrorKind::StorageFull => "the disk is full: make room",
        ErrorKind::QuotaExceeded => "your quota is used up: make room",
        ErrorKind::FileTooLarge => {
            "files may not be so large here: raise the limit (ulimit -f unlimited)"
        }
        ErrorKind::ReadOnlyFilesystem => "the file system can only be read: write elsewhere",
        ErrorKind::PermissionDenied => {
            "you may not write there: write elsewhere, or change the permissions"
        }
        ErrorKind::NotFound => "its folder is gone",
        _ => return Error::unwritable(path.display(), expected).found(error),
    };
    let error = Error::unwritable(path.display(), expected).found(error);
    error.hint(format!("{hint}{then}"))
}

/// What the beginning of a file shows to stand there in its place, and what to do: a pointer, a page, an archive.
pub fn in_place_of(bytes: &[u8]) -> Option<(String, &'static str)> {
    const LFS: &[u8] = b"version https://git-lfs.github.com/spec/";
    let start = bytes.trim_ascii_start();
    let begins = |with: &str| {
        let start = start.get(..with.len());
        start.is_some_and(|s| s.eq_ignore_ascii_case(with.as_bytes()))
    };
    if start.starts_with(LFS) {
        let text = String::from_utf8_lossy(&start[..start.len().min(500)]).into_owned();
        let size = text.lines().find_map(|l| l.strip_prefix("size "));
        let size = size.map_or(String::new(), |s| format!(", of {s} bytes"));
        return Some((
            format!("a pointer of Git LFS to the file{size}"),
            "fetch the file itself: git lfs install; git lfs pull",
        ));
    }
    if start.len() < 500
        && (begins("/annex/objects/") || begins("../.git/annex/") || begins(".git/annex/"))
    {
        let hint = "fetch the file itself: git annex get FILE";
        return Some(("a pointer of git-annex to the file".into(), hint));
    }
    if begins("<!doctype html") || begins("<html") {
        let hint = "download the file itself (on GitHub: Raw), not the page that shows it";
        return Some(("a web page".into(), hint));
    }
    let packed = match bytes {
        [0x1f, 0x8b, ..] => "a gzip archive",
        [b'P', b'K', 3, 4, ..] => "a zip archive",
        [b'7', b'z', 0xbc, 0xaf, ..] => "a 7z archive",
        _ => return binary(bytes).map(|(what, hint)| (what.into(), hint)),
    };
    Some((
        packed.into(),
        "unpack it and give the file that is in it; of an Excel workbook save the sheet as CSV",
    ))
}

/// Whether bytes are those of HDF5 or netCDF, in which programs of every kind keep their data.
pub fn is_hierarchical(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"CDF")
}

/// What a file of no text is, and how to save it otherwise.
fn binary(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const MATLAB: &str =
        "save it in MATLAB with save('field.mat', 'x', 'y', 'u', 'v', '-v7'), or as a table";
    const HDF5: &str = "of MATLAB save with '-v7'; of ArviZ or PyMC xarray.open_datatree(FILE).to_zarr('chains.zarr'); of emcee numpy.savez('chain.npz', chain=backend.get_chain(), log_prob=backend.get_log_prob())";
    const KINDS: [(&[u8], &str, &str); 6] = [
        (b"\x89HDF", "an HDF5 file", HDF5),
        (b"MATLAB 7.3", "a .mat file of MATLAB 7.3 (HDF5)", MATLAB),
        (b"CDF", "a netCDF file", HDF5),
        (b"PAR1", "a Parquet file", "save it as CSV"),
        (b"ARROW1", "an Arrow file", "save it as CSV"),
        (b"\xd0\xcf\x11\xe0", "an Excel workbook", "save it as CSV"),
    ];
    let kind = KINDS.iter().find(|(start, ..)| bytes.starts_with(start));
    kind.map(|(_, what, hint)| (*what, *hint))
}

/// The parts of a line; delimiters between quotation marks do not separate.
pub fn cells(line: &str, ends: impl Fn(char) -> bool) -> impl Iterator<Item = &str> {
    let mut inside = false;
    line.split(move |c: char| {
        inside ^= c == '"';
        !inside && ends(c)
    })
}

/// The bytes of a text without a byte order mark, in UTF-8 if the mark is that of UTF-16.
pub fn plain(bytes: Vec<u8>) -> Vec<u8> {
    type Unit = fn([u8; 2]) -> u16;
    let unit: Unit = match bytes.as_slice() {
        [0xef, 0xbb, 0xbf, rest @ ..] => return rest.to_vec(),
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return bytes,
    };
    let units: Vec<u16> = bytes[2..]
        .as_chunks::<2>()
        .0
        .iter()
        .map(|pair| unit(*pair))
        .collect();
    String::from_utf16_lossy(&units).into_bytes()
}

/// A path that means the same from anywhere.
///
/// # Errors
/// Of the input: a current directory that is gone.
pub fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path)
        .map_err(|e| Error::input(path.display(), "a path that can be made absolute").found(e))
}

/// Make a folder with those above it, if it is not there.
///
/// # Errors
/// The input's fault if it cannot be made.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| not_made(path, &e))
}

/// Parse the JSON text of `file`.
///
/// # Errors
/// The input's fault, with file, line, key path, what was found and what was expected.
pub fn parse_json<'a, T: Deserialize<'a>>(text: &'a str, file: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| json_error(file, &json_path(text, &e), &e))
}

/// Parse the JSON text of a part of a file, with an error that begins with the key path in it.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_part<T: serde::de::DeserializeOwned>(text: &str) -> std::result::Result<T, String> {
    serde_json::from_str(text).map_err(|e| {
        let (path, words) = (json_path(text, &e), e.to_string());
        let words = words.split(" at line ").next().unwrap_or_default();
        match path.as_str() {
            "." => words.into(),
            _ => format!("{path}: {words}"),
        }
    })
}

/// The path of keys to the place of an error, found from its line and column: a deserialiser that keeps a path would be compiled
/// once more for every type.
fn json_path(text: &str, error: &serde_json::Error) -> String {
    enum Level {
        Key(Option<String>),
        Index(usize),
    }
    let lines = text.split_inclusive('\n').map(str::len);
    let before: usize = lines.take(error.line().saturating_sub(1)).sum();
    let end = (before + error.column()).min(text.len());
    let bytes = &text.as_bytes()[..end];
    // of what was wrong below, the end of what holds it is all that is known
    let words = error.to_string();
    let own = ["missing field", "invalid length"];
    let of_holder = own.iter().any(|start| words.starts_with(start));
    let mut levels = Vec::new();
    let mut at = 0;
    while at < end {
        match bytes[at] {
            b'{' => levels.push(Level::Key(None)),
            b'[' => levels.push(Level::Index(0)),
            b'}' | b']' if of_holder || at + 1 < end => drop(levels.pop()),
            b',' => match levels.last_mut() {
                Some(Level::Index(k)) => *k += 1,
                Some(key) => *key = Level::Key(None),
                None => {}
            },
            b'"' => {
                let begin = at + 1;
                at = begin;
                while at < end && bytes[at] != b'"' {
                    at += 1 + usize::from(bytes[at] == b'\\');
                }
                if let Some(Level::Key(key @ None)) = levels.last_mut() {
                    let name = &bytes[begin..at.min(end)];
                    *key = Some(String::from_utf8_lossy(name).into_owned());
                }
            }
            _ => {}
        }
        at += 1;
    }
    let mut path = String::new();
    for level in levels {
        match level {
            Level::Key(Some(key)) if path.is_empty() => path = key,
            Level::Key(Some(key)) => path += &format!(".{key}"),
            Level::Key(None) => {}
            Level::Index(k) => path += &format!("[{k}]"),
        }
    }
    if path.is_empty() { ".".into() } else { path }
}

/// Parse a value that stands within `file`: where it starts (line and column, from 0), and its key there.
///
/// # Errors
/// The input's fault, with line, column and key in the whole file.
pub fn parse_json_within<T: serde::de::DeserializeOwned>(
    json: &str,
    file: &str,
    (start, key): ([usize; 2], &str),
) -> Result<T> {
    serde_json::from_str(json).map_err(|e| {
        let inner = match (key, json_path(json, &e)) {
            (key, path) if path == "." && !key.is_empty() => key.to_string(),
            ("", path) => path,
            (key, path) => format!("{key}.{path}"),
        };
        located(file, &inner, (&e, start))
    })
}

fn json_error(file: &str, key: &str, error: &serde_json::Error) -> Error {
    located(file, key, (error, [0; 2]))
}

fn located(file: &str, key: &str, (error, start): (&serde_json::Error, [usize; 2])) -> Error {
    let text = error.to_string();
    let text = text.split(" at line ").next().unwrap_or_default();
    let right = if error.line() == 1 { start[1] } else { 0 };
    let place = format!(
        "{file}:{}:{}",
        error.line() + start[0],
        error.column() + right
    );
    let place = if key == "." {
        place
    } else {
        format!("{place}: {key}")
    };
    if let Some((found, expected)) = text.split_once(", expected ") {
        return match found.split_once(": found ") {
            Some((inner, found)) => {
                Error::input(format!("{place}: {inner}"), expected).found(found)
            }
            None => {
                let found = found.trim_start_matches("invalid type: ");
                // the name of a type says nothing to who wrote the file
                let object = "an object: keys and values between { and }";
                let is_type = expected.starts_with("struct ");
                Error::input(place, if is_type { object } else { expected }).found(found)
            }
        };
    }
    if let Some((place_in, expected)) = text.split_once(": expected ") {
        return Error::input(format!("{place}: {place_in}"), expected);
    }
    if let Some(expected) = text.strip_prefix("expected ") {
        return Error::input(place, format!("{expected} in JSON"))
            .found("something else")
            .hint("a value is missing here, or stands where none belongs: only one key is allowed within \"prior\", and \"truncate\" stands beside it");
    }
    let expected = match error.classify() {
        serde_json::error::Category::Syntax | serde_json::error::Category::Eof => "valid JSON",
        _ => "the keys that this file has",
    };
    let error = Error::input(place, expected).found(text);
    match text {
        "key must be a string" => error.hint("a decimal comma, or a comma after the last entry? JSON has 900.5, and no comma before }"),
        _ => error,
    }
}

/// A map whose keys are all different: of two entries with one name, neither is likely to be the one that is meant.
pub fn unique<'de, D, T>(deserializer: D) -> std::result::Result<BTreeMap<String, T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: Deserialize<'de>,
{
    struct Unique<T>(std::marker::PhantomData<T>);
    impl<'de, T: Deserialize<'de>> serde::de::Visitor<'de> for Unique<T> {
        type Value = BTreeMap<String, T>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an object of values by parameter name")
        }

        fn visit_map<A: serde::de::MapAccess<'de>>(
            self,
            mut map: A,
        ) -> std::result::Result<Self::Value, A::Error> {
            let mut entries = BTreeMap::new();
            while let Some((name, value)) = map.next_entry::<String, T>()? {
                if entries.contains_key(&name) {
                    return Err(serde::de::Error::custom(format!(
                        "a second {name}, expected every name once"
                    )));
                }
                entries.insert(name, value);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_map(Unique(std::marker::PhantomData))
}

/// Write a value as a JSON file, indented.
///
/// # Errors
/// The input's fault if the file cannot be written; the program's if JSON cannot hold the value.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value)
        .map_err(|e| Error::program(path.display(), "what JSON can hold").found(e))?;
    text.push('\n');
    replace(path, text)
}

/// Hexadecimal digits of a hash.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// A number that JSON has as `null`, since it has neither infinity nor NaN.
pub fn or_nan<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<f64, D::Error> {
    Option::deserialize(from).map(|number| number.unwrap_or(f64::NAN))
}
