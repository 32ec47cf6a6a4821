//! Values put into a model file, key by key.

use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::study::Study;

/// The file at `path` with values in it, as JSON that can be read from anywhere. Keys are dotted (`experiments.0.load.force_N`) or JSON
/// pointers (`/experiments/0/load/force_N`).
///
/// # Errors
/// The input's fault: a key that the file has no place for, or a model that is refused.
pub fn changed(path: &Path, set: &Keyed<Value>) -> Result<Value> {
    let place = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::input(&place, "a readable model file").found(e))?;
    let mut file: Value = crate::files::parse_json(&text, &place)?;
    for (key, value) in set {
        put(&mut file, key, value).map_err(|e| e.within(&place))?;
    }
    let text = file.to_string();
    let said = |e: Error| {
        let keys: Vec<&str> = set.keys().map(String::as_str).collect();
        e.within(format!("with {} set", keys.join(", ")))
    };
    Study::parse(&text, path).map_err(said)?.json(true)
}

/// Put a value where a key says; the object that it stands in must be there.
pub fn put(file: &mut Value, key: &str, value: &Value) -> Result<()> {
    let pointer = match key.starts_with('/') {
        true => key.to_string(),
        false => format!("/{}", key.replace('.', "/")),
    };
    let missing = || {
        Error::input(
            key,
            "a key of the model file, such as experiments.0.load.force_N",
        )
        .found("no place for it")
    };
    if let Some(place) = file.pointer_mut(&pointer) {
        *place = value.clone();
        return Ok(());
    }
    // a key that may be left out: whoever reads the model says whether there is one
    let (parent, name) = pointer.rsplit_once('/').ok_or_else(missing)?;
    let parent = file.pointer_mut(parent).and_then(Value::as_object_mut);
    let name = name.replace("~1", "/").replace("~0", "~");
    parent.ok_or_else(missing)?.insert(name, value.clone());
    Ok(())
}
