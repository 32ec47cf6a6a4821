//! The header of a table in a text: the line with the names that are wanted, or else the one before the first row of numbers.

use std::path::Path;

use super::cells::{Delimiter, bare, column_name, number};
use crate::error::{Error, Result};

/// A header in a text.
pub(super) struct FoundHeader {
    pub names: Vec<String>,
    pub delimiter: Delimiter,
    pub line: usize,
    /// Number of the next line, and where it begins.
    pub after: (usize, usize),
}

/// The header of the table in `text`: the first that is `wanted`, or else that of the first line before a row of as many numbers.
///
/// # Errors
/// Of the input: no line is one.
pub(super) fn find(
    path: &Path,
    text: &str,
    wanted: &dyn Fn(&[String]) -> bool,
) -> Result<FoundHeader> {
    let found = wanted_header(text, wanted).or_else(|| guessed(text));
    found.ok_or_else(|| headless(path, text))
}

/// Whether a line begins with a word, in whatever letters.
pub(super) fn begins(line: &str, word: &str) -> bool {
    let line = line.trim_start();
    line.get(..word.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(word))
}

fn after_line(text: &str, line: &str) -> usize {
    let end = line.as_ptr() as usize - text.as_ptr() as usize + line.len();
    text[end..].find('\n').map_or(text.len(), |k| end + k + 1)
}

/// The names of the columns in a line.
fn names_in(line: &str, delimiter: Delimiter) -> Vec<String> {
    if let Some(names) = of_davis(line) {
        return names;
    }
    let mut cells = Vec::new();
    delimiter.split(line, &mut cells);
    let mut names: Vec<String> = Vec::new();
    for cell in &cells {
        let name = column_name(cell);
        match names.last_mut() {
            // a unit stands apart from its name
            Some(last) if delimiter == Delimiter::Blanks && name.starts_with(['[', '(']) => {
                *last = format!("{last} {name}");
            }
            _ => names.push(name.to_string()),
        }
    }
    if delimiter == Delimiter::Blanks {
        // what remains of "# x y", "# Format: x y" and "VARIABLES = x y"
        let rest = ["", "=", "variables", "format:"];
        names.retain(|name| !rest.contains(&name.to_lowercase().as_str()));
    }
    while names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    names
}

/// DaVis 8 names the quantities of its axes and their units in one line: `#DaVis 8.4.0 2D-vector 12 200 300 "" "pixel" "" "pixel"
/// "displacement" "pixel"`.
fn of_davis(line: &str) -> Option<Vec<String>> {
    let (_, quoted) = line
        .trim_start()
        .strip_prefix('#')?
        .split_once("2D-vector")?;
    let parts: Vec<&str> = quoted.split('"').collect();
    let unit = |k: usize| parts.get(4 * k + 3).map(|unit| unit.trim());
    let units = [unit(0)?, unit(1)?, unit(2)?, unit(2)?];
    let names = ["x", "y", "Vx", "Vy"].into_iter().zip(units);
    Some(
        names
            .map(|(name, unit)| format!("{name} [{unit}]"))
            .collect(),
    )
}

/// The first header that is `wanted`.
fn wanted_header(text: &str, wanted: &dyn Fn(&[String]) -> bool) -> Option<FoundHeader> {
    let mut lines = text.lines().enumerate().peekable();
    while let Some((k, line)) = lines.next() {
        if line
            .trim_start()
            .starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
        {
            continue;
        }
        let mut whole = line.to_string();
        let (mut last, mut end) = (k, line);
        if begins(line, "variables") {
            while let Some((m, next)) =
                lines.next_if(|(_, next)| next.trim_start().starts_with('"'))
            {
                whole = format!("{whole} {next}");
                (last, end) = (m, next);
            }
        }
        for delimiter in Delimiter::ALL {
            let names = names_in(&whole, delimiter);
            if names.len() >= 4 && wanted(&names) {
                let after = (last + 2, after_line(text, end));
                return Some(FoundHeader {
                    names,
                    delimiter,
                    line: k + 1,
                    after,
                });
            }
        }
    }
    None
}

/// The last line with words before the first row of numbers, if it has as many cells.
fn guessed(text: &str) -> Option<FoundHeader> {
    let mut before: Option<(usize, &str)> = None;
    let mut cells = Vec::new();
    let mut fallback = None;
    for (k, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let mut row_of = |delimiter: Delimiter| {
            delimiter.split(line, &mut cells);
            let all = cells
                .iter()
                .all(|c| number(c, false).is_some() || number(c, true).is_some());
            (all && cells.len() > 1).then_some(cells.len())
        };
        let Some((m, header)) = before else {
            if Delimiter::ALL.into_iter().any(|d| row_of(d).is_some()) {
                return None;
            }
            before = Some((k, line));
            continue;
        };
        for delimiter in Delimiter::ALL {
            let names = names_in(header, delimiter);
            let found = || FoundHeader {
                names: names.clone(),
                delimiter,
                line: m + 1,
                after: (m + 2, after_line(text, header)),
            };
            if names.len() > 1
                && row_of(delimiter).is_some_and(|n| n == names.len() || n == names.len() + 1)
            {
                return Some(found());
            }
            if fallback.is_none() && names.len() > 3 {
                fallback = Some(found());
            }
        }
        before = Some((k, line));
    }
    let alone = before.filter(|_| fallback.is_none()).map(|(k, line)| {
        let of = |delimiter: &Delimiter| names_in(line, *delimiter).len();
        let delimiter = Delimiter::ALL
            .into_iter()
            .max_by_key(of)
            .unwrap_or(Delimiter::Blanks);
        FoundHeader {
            names: names_in(line, delimiter),
            delimiter,
            line: k + 1,
            after: (k + 2, after_line(text, line)),
        }
    });
    fallback.or(alone)
}

/// There is no header.
fn headless(path: &Path, text: &str) -> Error {
    let error = Error::input(path.display(), "a header line and rows of numbers");
    match text
        .lines()
        .enumerate()
        .find(|(_, line)| !line.trim().is_empty())
    {
        None => error.found("an empty file"),
        Some((k, line)) => Error::input(
            format!("{}:{}", path.display(), k + 1),
            "a line with the names of the columns before the numbers",
        )
        .found(bare(line))
        .hint(
            "export with a header, or write one as the first line, such as x_mm,y_mm,ux_mm,uy_mm",
        ),
    }
}
