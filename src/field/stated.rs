//! Forces and times that the file of a table states beside its points.

use std::path::Path;

use super::cells::number;
use super::programs::{matching, newtons, seconds};
use super::sheet::Sheet;
use super::text;
use crate::error::Result;

/// Words of a force and of a time, in small letters.
const FORCE: &[&str] = &["force", "load", "kraft"];
const TIME: &[&str] = &["time", "relative_time", "zeit", "temps"];

/// The force that the lines before the numbers of a table state (ARAMIS: `# force : 15000`), N; without a unit it is
/// taken for newtons.
///
/// # Errors
/// Of the input: a missing or non-text file.
pub fn stated_force(path: &Path) -> Result<Option<f64>> {
    before_numbers(path, FORCE, |unit| Some(newtons(unit)?.1))
}

/// The time that the lines before the numbers of a table state, or a column of it in the first row, seconds.
///
/// # Errors
/// Of the input: a missing or non-text file, a file without a table.
pub fn stated_time(path: &Path) -> Result<Option<f64>> {
    if let Some(time) = before_numbers(path, TIME, seconds)? {
        return Ok(Some(time));
    }
    let sheet = Sheet::open(path, &|names| matching(names, None, "").is_some())?;
    let is_time = |name: &String| {
        let words = name.to_lowercase();
        let stem = words.split(['[', '(']).next().unwrap_or_default().trim();
        TIME.contains(&stem.strip_suffix("_s").unwrap_or(stem))
    };
    let Some(column) = sheet.names.iter().position(is_time) else {
        return Ok(None);
    };
    let mut time = None;
    sheet.rows(&mut |_, cells| {
        time = time.or_else(|| number(cells.get(column)?, sheet.comma));
        Ok(())
    })?;
    Ok(time.filter(|t| t.is_finite()))
}

/// What a line before the numbers states of a quantity.
fn before_numbers(
    path: &Path,
    words: &[&str],
    size: impl Fn(&str) -> Option<f64>,
) -> Result<Option<f64>> {
    let (text, _) = text::read(path)?;
    let number = |line: &&str| line.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
    let mut before = lines.take_while(|line| !number(line));
    Ok(before
        .find_map(|line| quantity_in(line.trim_start_matches(['#', '%', '*', ' ']), words, &size)))
}

/// The quantity of a line `force [kN] : 1.5`, `Force = 1500 N`, `force : value_element : 1500`.
fn quantity_in(line: &str, names: &[&str], size: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    let (key, value) = line.split_once([':', '=', ';', ',', '\t'])?;
    let value = value.rsplit_once(':').map_or(value, |(_, value)| value);
    let apart = |c: char| c.is_whitespace() || "[]()_;\"".contains(c);
    let words = |text| -> Vec<&str> {
        let words = str::split(text, apart);
        words.filter(|w| !w.is_empty()).collect()
    };
    let (key, value) = (words(key), words(value));
    if !names.contains(&key.first()?.to_lowercase().as_str()) {
        return None;
    }
    let number = number(value.first()?, false).filter(|f| f.is_finite())?;
    let mut units = key[1..].iter().chain(&value[1..]);
    let sizes: Option<Vec<f64>> = units.by_ref().map(|unit| size(unit)).collect();
    Some(number * sizes?.first().unwrap_or(&1.0))
}
