//! Which rows of a machine's record are which step's.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::machine_file::MachineFile;
use crate::error::{Error, Result};
use crate::field::programs::{self, newtons};
use crate::field::table;

/// What columns of picture numbers are called.
const NUMBERS: [&str; 14] = [
    "index", "count", "image", "picture", "frame", "photo", "bild", "stage", "step", "number",
    "no", "nr", "file", "#",
];

/// Words of a column's name and the unit that it states.
pub fn parts(name: &str) -> (Vec<String>, Option<(&'static str, f64)>) {
    let apart = |c: char| !(c.is_alphanumeric() || c == '#');
    let words: Vec<&str> = name.split(apart).filter(|w| !w.is_empty()).collect();
    // the first word is the name, whatever else it means
    let unit = words.iter().skip(1).find_map(|w| newtons(w));
    (words.into_iter().map(str::to_lowercase).collect(), unit)
}

/// A record of forces.
#[derive(Clone, Copy)]
pub struct ForceRecord<'a> {
    pub file: &'a MachineFile,
    /// Column of the force.
    pub force: usize,
    /// Number of a picture in the file less that in the name of its field.
    pub offset: Option<i64>,
    /// The file, for errors.
    pub place: &'a str,
}

impl ForceRecord<'_> {
    /// The rows of every step: by names, times or numbers of the pictures, or by their order.
    ///
    /// # Errors
    /// Of the input: a file that does not tell which row is which step's.
    pub fn rows(&self, steps: &[PathBuf]) -> Result<StepRows> {
        let file = self.file;
        if self.offset.is_none()
            && let Some(found) = by_name(file, steps)
        {
            return Ok(found);
        }
        if self.offset.is_none()
            && let Some(found) = self.by_time(steps)?
        {
            return Ok(found);
        }
        if let Some(column) = number_column(file, self.force) {
            return self.by_number(column, steps);
        }
        let order = |first: usize| (first..file.rows.len()).map(|r| vec![(r, 1.0)]).collect();
        let (rows, count) = (file.rows.len(), steps.len());
        if rows == count {
            return Ok(StepRows::of(
                order(0),
                None,
                "matched by their order, a row a step",
            ));
        }
        if rows == count + 1 {
            let how = "matched by their order, the first row that of the reference picture";
            return Ok(StepRows::of(order(1), Some(vec![(0, 1.0)]), how));
        }
        Err(Error::input(self.place, "a column with the number or the name of each picture")
            .found(format!("{} rows for {count} steps, of {}", rows, file.names.join(", ")))
            .hint("export the forces with the pictures' numbers, or leave a row for each step and one before them for the reference picture"))
    }

    fn by_number(&self, column: usize, steps: &[PathBuf]) -> Result<StepRows> {
        let file = self.file;
        let mut rows: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for row in 0..file.rows.len() {
            if let Some(n) = file.number(row, column).filter(|n| n.fract() == 0.0) {
                rows.entry(n as i64).or_default().push(row);
            }
        }
        let offset = self.offset.unwrap_or(0);
        let numbers = numbers(steps).ok_or_else(|| {
            Error::input(
                "--csv",
                "files with the numbers of their pictures in their names",
            )
            .found(
                steps
                    .first()
                    .map_or_else(String::new, |s| s.display().to_string()),
            )
        })?;
        let range = rows.keys().next().zip(rows.keys().last());
        let (first, last) = range.map_or((0, 0), |(a, b)| (*a, *b));
        let mut of_steps = Vec::with_capacity(steps.len());
        for (step, number) in steps.iter().zip(&numbers) {
            let wanted = number + offset;
            let found = rows.get(&wanted).ok_or_else(|| {
                Error::input(self.place, format!("picture {wanted}, of {}", step.display()))
                    .found(format!("pictures {first} to {last}"))
                    .hint("the file counts otherwise? --force-offset N: its number less that in the fields' names")
            })?;
            of_steps.push(alike(found.clone()));
        }
        let lowest = numbers.iter().min().map_or(0, |n| n + offset);
        let before = rows.first_key_value().filter(|(n, _)| **n < lowest);
        let how = format!(
            "matched by the pictures' numbers, \"{}\" {first} to {last}, offset {offset} (--force-offset changes it)",
            file.names[column]
        );
        let reference = before.map(|(_, rows)| alike(rows.clone()));
        Ok(StepRows::of(of_steps, reference, &how))
    }

    /// By a column of times, where every step's file states when its picture was taken: in its name, a line or a column.
    ///
    /// # Errors
    /// Of the input: times outside of the record, or a record that does not go on in time.
    fn by_time(&self, steps: &[PathBuf]) -> Result<Option<StepRows>> {
        let Self { file, place, .. } = *self;
        let is_time = |name: &String| {
            parts(name)
                .0
                .first()
                .is_some_and(|w| TIMES.contains(&w.as_str()))
        };
        let Some(column) = file.names.iter().position(is_time) else {
            return Ok(None);
        };
        let of_step = |step: &PathBuf| {
            let name = step.file_name().unwrap_or_default().to_string_lossy();
            match programs::in_name(&name, programs::seconds) {
                Some(time) => Ok(Some(time)),
                None => table::stated_time(step),
            }
        };
        let pictures: Option<Vec<f64>> = steps.iter().map(of_step).collect::<Result<_>>()?;
        let unit = file.names[column].split(|c: char| !c.is_alphanumeric());
        let unit = unit.skip(1).find_map(programs::seconds).unwrap_or(1.0);
        let rows = (0..file.rows.len()).filter_map(|r| Some((r, unit * file.number(r, column)?)));
        let (Some(pictures), record) = (pictures, rows.collect::<Vec<(usize, f64)>>()) else {
            return Ok(None);
        };
        if let Some(pair) = record.windows(2).find(|w| w[1].1 < w[0].1) {
            let line = file.rows[pair[1].0].0;
            let error = Error::input(
                format!("{place}:{line}"),
                "times that go on from row to row",
            );
            return Err(error.found(format!("{} after {} s", pair[1].1, pair[0].1)));
        }
        let ends = record.first().zip(record.last());
        let [first, last] = ends.map_or([f64::NAN; 2], |(a, b)| [a.1, b.1]);
        let at = |(step, time): (&PathBuf, &f64)| {
            shares(&record, *time).ok_or_else(|| {
                let expected = format!("the force at {time} s, of {}", step.display());
                Error::input(place, expected)
                    .found(format!("times {first} to {last} s"))
                    .hint("do both clocks start together? shift the record's times")
            })
        };
        let steps = steps.iter().zip(&pictures).map(at).collect::<Result<_>>()?;
        let how = "interpolated over time at the times of the pictures";
        Ok(Some(StepRows {
            is_interpolated: true,
            ..StepRows::of(steps, None, how)
        }))
    }
}

/// The rows of a record over time about a moment, each with its share; none outside of the record.
fn shares(record: &[(usize, f64)], time: f64) -> Option<Vec<(usize, f64)>> {
    let next = record.partition_point(|(_, t)| *t < time);
    let (row, to) = *record.get(next)?;
    if to == time {
        return Some(vec![(row, 1.0)]);
    }
    let (before, from) = *record.get(next.checked_sub(1)?)?;
    let share = (time - from) / (to - from);
    Some(vec![(before, 1.0 - share), (row, share)])
}

/// Rows of a file by what they are of, each with its share in the force.
pub struct StepRows {
    pub steps: Vec<Vec<(usize, f64)>>,
    pub reference: Option<Vec<(usize, f64)>>,
    /// How they were found.
    pub how: String,
    pub is_interpolated: bool,
}

impl StepRows {
    fn of(steps: Vec<Vec<(usize, f64)>>, reference: Option<Vec<(usize, f64)>>, how: &str) -> Self {
        Self {
            steps,
            reference,
            how: how.into(),
            is_interpolated: false,
        }
    }
}

/// Rows of equal shares.
fn alike(rows: Vec<usize>) -> Vec<(usize, f64)> {
    let share = 1.0 / rows.len().max(1) as f64;
    rows.into_iter().map(|row| (row, share)).collect()
}

/// What columns of times are called.
const TIMES: [&str; 7] = ["time", "zeit", "temps", "tiempo", "tempo", "elapsed", "t"];

/// By a column of file names: the longest that a step's name has in it.
fn by_name(file: &MachineFile, steps: &[PathBuf]) -> Option<StepRows> {
    let stem = |cell: &str| -> Option<String> {
        let path = Path::new(cell.rsplit(['/', '\\']).next()?);
        path.extension()?;
        let stem = path.file_stem()?.to_string_lossy().to_lowercase();
        stem.chars().any(char::is_alphabetic).then_some(stem)
    };
    let is_of_names = |k: &usize| (0..file.rows.len()).all(|r| stem(file.cell(r, *k)).is_some());
    let column = (0..file.names.len()).find(is_of_names)?;
    let names: Vec<String> = (0..file.rows.len())
        .filter_map(|r| stem(file.cell(r, column)))
        .collect();
    let of_step = |step: &PathBuf| -> Option<Vec<usize>> {
        let own = step.file_name()?.to_string_lossy().to_lowercase();
        let fitting = names.iter().filter(|n| own.contains(n.as_str()));
        let name = fitting.max_by_key(|n| n.len())?;
        Some((0..names.len()).filter(|r| names[*r] == *name).collect())
    };
    let found: Vec<Vec<usize>> = steps.iter().map(of_step).collect::<Option<_>>()?;
    let first = found.iter().flatten().min().copied()?;
    let reference =
        (first > 0).then(|| alike((0..first).filter(|r| names[*r] == names[0]).collect()));
    let steps = found.into_iter().map(alike).collect();
    Some(StepRows::of(
        steps,
        reference,
        "matched by the pictures' names",
    ))
}

/// The column of picture numbers: by its name, or else the first one if it counts.
fn number_column(file: &MachineFile, force: usize) -> Option<usize> {
    let counts = |k: usize| {
        let whole = |r: usize| {
            file.number(r, k)
                .is_some_and(|n| n.fract() == 0.0 && n.abs() < 1e9)
        };
        (0..file.rows.len()).all(whole)
    };
    let is_named = |k: &usize| {
        let (words, _) = parts(&file.names[*k]);
        *k != force && words.iter().any(|w| NUMBERS.contains(&w.as_str())) && counts(*k)
    };
    let named = (0..file.names.len()).find(is_named);
    let rises = |k: usize| (1..file.rows.len()).all(|r| file.number(r, k) > file.number(r - 1, k));
    named.or_else(|| (force != 0 && file.rows.len() > 1 && counts(0) && rises(0)).then_some(0))
}

/// The numbers of steps: those in their names that differ, the longest if only one step is there.
fn numbers(steps: &[PathBuf]) -> Option<Vec<i64>> {
    let all: Vec<Vec<String>> = steps
        .iter()
        .map(|step| {
            let stem = step.file_stem().unwrap_or_default().to_string_lossy();
            let digits = stem
                .split(|c: char| !c.is_ascii_digit())
                .filter(|d| !d.is_empty());
            digits.map(String::from).collect()
        })
        .collect();
    let places = all.iter().map(Vec::len).min()?;
    let differ = |k: &usize| {
        let mut here: Vec<&String> = all.iter().map(|n| &n[*k]).collect();
        here.sort_unstable();
        here.windows(2).all(|w| w[0] != w[1])
    };
    let place = match all.as_slice() {
        [one] => (0..places).max_by_key(|k| one[*k].len())?,
        _ => (0..places).rev().find(differ)?,
    };
    all.iter().map(|n| n[place].parse().ok()).collect()
}
