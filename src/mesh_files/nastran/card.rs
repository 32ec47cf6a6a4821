//! Cards of bulk data: a line of free, small or large fields with those that go on with it.

use super::super::draft::FileSpot;
use crate::error::{Error, Result};

/// An entry of bulk data.
#[derive(Debug)]
pub(super) struct BulkCard {
    /// In capitals, without the asterisk of large fields.
    pub name: String,
    /// Fields after the name, without those of continuations; trimmed.
    fields: Vec<String>,
    /// Of the file, from 1.
    pub line: u32,
}

impl BulkCard {
    /// A field, counted from 0 after the name; empty if it is not there.
    pub fn field(&self, index: usize) -> &str {
        self.fields.get(index).map_or("", String::as_str)
    }

    pub fn spot(&self) -> FileSpot {
        FileSpot {
            file: 0,
            line: self.line,
        }
    }

    fn wrong(&self, index: usize, expected: &str) -> Error {
        let found = match self.field(index) {
            "" => "an empty field",
            field => field,
        };
        Error::input(format!("field {} of {}", index + 2, self.name), expected)
            .found(found)
            .hint(
                "a line is cut short, or its fields are not 8 (16) columns wide or between commas",
            )
    }

    /// A positive whole number.
    pub fn number(&self, index: usize, expected: &str) -> Result<u64> {
        let number = self.field(index).parse::<u64>().ok();
        let number = number.filter(|n| *n > 0 && *n < u64::MAX);
        number.ok_or_else(|| self.wrong(index, expected))
    }

    /// A finite number, 0 for an empty field.
    pub fn real(&self, index: usize) -> Result<f64> {
        let field = self.field(index);
        let value = if field.is_empty() {
            Some(0.0)
        } else {
            real(field)
        };
        let value = value.filter(|v| v.is_finite());
        value.ok_or_else(|| self.wrong(index, "a finite number"))
    }
}

/// A number as NASTRAN writes it: `1.5-3` is 0.0015, and so is `1.5D-3`.
fn real(field: &str) -> Option<f64> {
    let text = field.replace(['d', 'D'], "e");
    let signs = text
        .char_indices()
        .skip(1)
        .filter(|(_, c)| "+-".contains(*c));
    let bare = signs
        .map(|(at, _)| at)
        .find(|at| !text[..*at].ends_with(['e', 'E']));
    match bare {
        Some(at) => format!("{}e{}", &text[..at], &text[at..]).parse().ok(),
        None => text.parse().ok(),
    }
}

/// Fields of a card's line beside the name.
const FIELDS: usize = 8;

/// Columns up to which fields are read.
const SMALL: usize = 8;
const LARGE: usize = 16;

/// The cards between `BEGIN BULK`, if it is there, and `ENDDATA`.
pub(super) fn cards(bytes: &[u8]) -> Vec<BulkCard> {
    let mut all: Vec<BulkCard> = Vec::new();
    // fields of the last card that its lines so far have room for
    let mut room = 0;
    for (at, line) in (1u32..).zip(bytes.split(|b| *b == b'\n')) {
        let text = untabbed(&String::from_utf8_lossy(line));
        let text = text.split('$').next().unwrap_or_default().trim_end();
        let upper = text.trim_start().to_ascii_uppercase();
        if upper.is_empty() {
            continue;
        }
        let mut words = upper.split_whitespace();
        if words.next() == Some("BEGIN") && words.next().is_some_and(|w| w.starts_with("BULK")) {
            all.clear();
            continue;
        }
        let (name, fields) = fields(text);
        let goes_on = name.is_empty() || name.starts_with(['+', '*']);
        match all.last_mut() {
            Some(card) if goes_on => card.fields.resize(room, String::new()),
            None if goes_on => continue,
            _ => {
                room = 0;
                all.push(BulkCard {
                    name: name.trim_end_matches('*').to_ascii_uppercase(),
                    fields: Vec::new(),
                    line: at,
                });
            }
        }
        let is_large = name.contains('*');
        room += if is_large { FIELDS / 2 } else { FIELDS };
        if let Some(card) = all.last_mut() {
            card.fields.extend(fields);
            if card.name == "ENDDATA" {
                break;
            }
        }
    }
    all
}

/// A line without tabs: each ends the field that it stands in.
fn untabbed(line: &str) -> String {
    if line.contains(',') {
        return line.replace('\t', " ");
    }
    let name = line.split('\t').next().unwrap_or_default();
    let width = if name.contains('*') { LARGE } else { SMALL };
    let (mut text, mut columns, mut is_full) = (String::new(), 0, false);
    for c in line.chars() {
        if c != '\t' {
            text.push(c);
            columns += 1;
            is_full = columns >= SMALL && (columns - SMALL).is_multiple_of(width);
            continue;
        }
        let rest = match columns {
            // a field that is full ends here already
            _ if is_full => 0,
            0..SMALL => SMALL - columns,
            _ => width - (columns - SMALL) % width,
        };
        text.extend(std::iter::repeat_n(' ', rest));
        columns += rest;
        is_full = false;
    }
    text
}

/// The name of a line and its fields, at most as many as there is room for.
fn fields(text: &str) -> (String, Vec<String>) {
    let trimmed = |field: &str| field.trim().to_string();
    if text.contains(',') {
        let mut parts = text.split(',');
        let name = trimmed(parts.next().unwrap_or_default());
        let count = if name.contains('*') {
            FIELDS / 2
        } else {
            FIELDS
        };
        return (name, parts.take(count).map(trimmed).collect());
    }
    let columns: Vec<char> = text.chars().collect();
    let part = |from: usize, width: usize| -> String {
        let to = (from + width).min(columns.len());
        let text: String = columns.get(from..to).unwrap_or(&[]).iter().collect();
        trimmed(&text)
    };
    let name = part(0, SMALL);
    let (width, count) = match name.contains('*') {
        true => (LARGE, FIELDS / 2),
        false => (SMALL, FIELDS),
    };
    let fields = (0..count).map(|k| part(SMALL + k * width, width));
    (name, fields.collect())
}
