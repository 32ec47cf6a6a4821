//! Lines of an input file: keywords with their options, data between commas.

use crate::error::{Error, Result};
use crate::files::cells;

/// A keyword line, `*NAME, KEY=VALUE, FLAG`.
#[derive(Debug)]
pub(super) struct Keyword {
    /// In capitals, without blanks: `ENDPART`.
    pub name: String,
    options: Vec<(String, String)>,
}

impl Keyword {
    /// Of a line (or several, joined) that begins with an asterisk.
    pub fn of(line: &str) -> Self {
        let mut fields = fields(line.trim_start_matches('*')).into_iter();
        let squeezed = |text: &str| -> String {
            let letters = text.chars().filter(|c| !c.is_whitespace());
            letters.flat_map(char::to_uppercase).collect()
        };
        let name = fields.next().map(squeezed).unwrap_or_default();
        let option = |field: &str| {
            let (key, value) = field.split_once('=').unwrap_or((field, ""));
            (squeezed(key), unquoted(value).to_string())
        };
        let options = fields.filter(|f| !f.is_empty()).map(option).collect();
        Self { name, options }
    }

    /// The value of an option, if it is there and not empty.
    pub fn get(&self, key: &str) -> Option<&str> {
        let option = self.options.iter().find(|(k, _)| k == key)?;
        Some(option.1.as_str()).filter(|v| !v.is_empty())
    }

    /// Whether an option is there, with a value or without.
    pub fn has(&self, key: &str) -> bool {
        self.options.iter().any(|(k, _)| k == key)
    }

    /// The value of an option that must be there.
    ///
    /// # Errors
    /// The input's fault, at `place`, if it is not.
    pub fn need(&self, key: &str, place: impl Fn() -> String) -> Result<&str> {
        self.get(key).ok_or_else(|| {
            Error::input(place(), format!("{key}=.. in *{}", self.name)).found("no such option")
        })
    }
}

/// The fields of a line, trimmed; commas between quotes do not separate. A comma at the end opens no further field.
pub(super) fn fields(line: &str) -> Vec<&str> {
    let mut all: Vec<&str> = cells(line, |c| c == ',').map(str::trim).collect();
    if all.last().is_some_and(|last| last.is_empty()) {
        all.pop();
    }
    all
}

/// A name without its quotes.
pub(super) fn unquoted(name: &str) -> &str {
    name.trim().trim_matches('"').trim()
}

/// The key that a name is found by.
pub(super) fn key(name: &str) -> String {
    unquoted(name).to_lowercase()
}

/// A positive whole number, or none.
pub(super) fn number(field: &str) -> Option<u64> {
    field.parse().ok().filter(|n| *n > 0 && *n < u64::MAX)
}

/// A number as Fortran writes it: `1.`, `.5`, `1D3`; an empty field is zero.
pub(super) fn real(field: &str) -> Option<f64> {
    if field.is_empty() {
        return Some(0.0);
    }
    let parsed = field.parse().ok();
    parsed.or_else(|| field.replace(['d', 'D'], "e").parse().ok())
}
