//! Files written in one step, and JSON read with errors that name file, line and key.

use std::collections::BTreeMap;
use std::path::Path;

use indexmap::IndexMap;
use serde::Deserialize;

use crate::error::{Error, Result};

/// A JSON object of entries by name, in their order.
pub type Keyed<T> = IndexMap<String, T>;

/// Write a file beside its place and move it there, so that neither a kill nor a reader at the same time finds half of it.
///
/// # Errors
/// The input's fault if the file cannot be written.
pub fn replace(path: &Path, contents: impl AsRef<[u8]>) -> Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    std::fs::write(&beside, contents)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|e| Error::input(path.display(), "a file that can be written").found(e))
}

/// Make a folder with those above it, if it is not there.
///
/// # Errors
/// The input's fault if it cannot be made.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path)
        .map_err(|e| Error::input(path.display(), "a place that can be written").found(e))
}

/// Parse the JSON text of `file`.
///
/// # Errors
/// The input's fault, with file, line, key path, what was found and what was expected.
pub fn parse_json<'a, T: Deserialize<'a>>(text: &'a str, file: &str) -> Result<T> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut reader)
        .map_err(|e| json_error(file, &e.path().to_string(), e.inner()))?;
    reader.end().map_err(|e| json_error(file, ".", &e))?;
    Ok(value)
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
    serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_str(json)).map_err(|e| {
        let inner = match (key, e.path().to_string()) {
            (key, path) if path == "." && !key.is_empty() => key.to_string(),
            ("", path) => path,
            (key, path) => format!("{key}.{path}"),
        };
        located(file, &inner, (e.inner(), start))
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
            None => Error::input(place, expected).found(found),
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
    Error::input(place, expected).found(text)
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
