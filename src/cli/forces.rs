//! `init --forces`: the force of every step, from the testing machine's file.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::machine_file::MachineFile;
use crate::error::{Error, Result};
use crate::field::programs::{self, FORCE_UNITS, newtons};
use crate::field::table;

/// Where forces come from.
#[derive(Debug, Args)]
pub struct ForceArguments {
    /// File of the testing machine: a table with the number or name of each picture and its force (analog data of VIC, DAQ file of MatchID, any
    /// CSV)
    #[arg(long, value_name = "FILE", requires = "csv")]
    forces: Option<PathBuf>,
    /// Column of the force in that file
    #[arg(long, value_name = "NAME", requires = "forces")]
    force_column: Option<String>,
    /// Unit of the force, if the column's name does not state it: N, kN or lbf
    #[arg(long, value_name = "UNIT", requires = "forces")]
    force_unit: Option<String>,
    /// Picture number in the file of forces minus picture number in the names of the fields
    #[arg(
        long,
        value_name = "N",
        requires = "forces",
        allow_negative_numbers = true
    )]
    force_offset: Option<i64>,
}

/// What columns of forces are called.
const FORCES: [&str; 10] = [
    "force", "load", "kraft", "charge", "effort", "fuerza", "carga", "forza", "f", "p",
];

/// Words of columns of a stress, a force per width or a rate of loading.
const NO_FORCES: [&str; 8] = ["per", "rate", "stress", "mm", "mm2", "mm\u{b2}", "m", "s"];

/// What columns of picture numbers are called.
const NUMBERS: [&str; 14] = [
    "index", "count", "image", "picture", "frame", "photo", "bild", "stage", "step", "number",
    "no", "nr", "file", "#",
];

/// Forces of two steps this close, as a share of the largest, are of one load.
const SAME: f64 = 5e-3;

/// Words of a column's name and the unit that it states.
fn parts(name: &str) -> (Vec<String>, Option<(&'static str, f64)>) {
    let apart = |c: char| !(c.is_alphanumeric() || c == '#');
    let words: Vec<&str> = name.split(apart).filter(|w| !w.is_empty()).collect();
    // the first word is the name, whatever else it means
    let unit = words.iter().skip(1).find_map(|w| newtons(w));
    (words.into_iter().map(str::to_lowercase).collect(), unit)
}

impl ForceArguments {
    /// Put the forces into the experiment; returns what is said of them.
    ///
    /// # Errors
    /// Of the input: a file that does not tell which force is which step's, or in which unit.
    pub fn apply(&self, steps: &[PathBuf], experiment: &mut Value) -> Result<String> {
        let Some(path) = &self.forces else {
            return Ok(String::new());
        };
        let file = MachineFile::read(path)?;
        let place = path.display().to_string();
        let column = self.column(&file, &place)?;
        let (unit, newtons) = self.unit(&file.names[column], &place)?;
        let (rows, how) = self.matched(&file, column, steps, &place)?;
        let mut said = format!(
            "\nforces from {place}: column \"{}\" in {unit}, {how}{}\n",
            file.names[column],
            if file.has_commas {
                ", with decimal commas"
            } else {
                ""
            }
        );
        let mean = |rows: &[(usize, f64)]| {
            let share = |(row, share): &(usize, f64)| Some(share * file.number(*row, column)?);
            let all: Option<Vec<f64>> = rows.iter().map(share).collect();
            all.filter(|a| !a.is_empty())
                .map(|a| newtons * a.iter().sum::<f64>())
        };
        let of = |what: &str, rows: &[(usize, f64)]| {
            mean(rows).ok_or_else(|| {
                let line = rows.first().map_or(0, |r| file.rows[r.0].0);
                Error::input(format!("{place}:{line}"), format!("the force of {what}"))
                    .found(rows.first().map_or("", |r| file.cell(r.0, column)))
            })
        };
        let mut reference = 0.0;
        if let Some(rows) = &rows.reference {
            reference = of("the reference picture", rows)?;
            let _ = writeln!(
                said,
                "  {} N are subtracted from all forces: the picture before the first step is taken for the reference picture",
                round(reference)
            );
        } else {
            said += "  no row belongs to the reference picture. plychain takes the forces as they are: this is right only if that picture was taken without load\n";
        }
        let mut forces = Vec::with_capacity(steps.len());
        for (step, rows) in steps.iter().zip(&rows.steps) {
            let force = round(of(&step.display().to_string(), rows)? - reference);
            let more = match (rows.len(), rows.iter().all(|r| r.1 == rows[0].1)) {
                (1, _) => String::new(),
                (count, true) => format!(", the mean of {count} rows"),
                (_, false) => ", between this and the next row".into(),
            };
            let line = rows.first().map_or(0, |r| file.rows[r.0].0);
            let _ = writeln!(
                said,
                "    {}: force_N {force} (line {line}{more})",
                step.display()
            );
            forces.push(force);
        }
        said += &repeats(&forces);
        match experiment.get_mut("steps").and_then(Value::as_array_mut) {
            Some(of_steps) => {
                for (step, force) in of_steps.iter_mut().zip(forces) {
                    step["force_N"] = json!(force);
                }
            }
            None => experiment["load"]["force_N"] = json!(forces.first()),
        }
        Ok(said)
    }

    fn column(&self, file: &MachineFile, place: &str) -> Result<usize> {
        if let Some(wanted) = &self.force_column {
            let mut names = file.names.iter();
            let known = names.clone().map(String::as_str);
            return names
                .position(|n| n.eq_ignore_ascii_case(wanted))
                .ok_or_else(|| Error::one_of("--force-column", known, wanted));
        }
        let is_force = |name: &String| {
            let (words, _) = parts(name);
            let is_other = words.iter().any(|w| NO_FORCES.contains(&w.as_str()));
            !is_other && words.iter().any(|w| FORCES.contains(&w.as_str()))
        };
        let all = file.names.iter().enumerate().filter(|(_, n)| is_force(n));
        let all: Vec<usize> = all.map(|(k, _)| k).collect();
        match all[..] {
            [one] => Ok(one),
            [] => Err(Error::input(place, "a column of forces")
                .found(file.names.join(", "))
                .hint("say which: --force-column NAME")),
            _ => {
                let all: Vec<&str> = all.iter().map(|k| file.names[*k].as_str()).collect();
                Err(Error::input(place, "one column of forces")
                    .found(all.join(", "))
                    .hint("say which: --force-column NAME"))
            }
        }
    }

    fn unit(&self, name: &str, place: &str) -> Result<(&'static str, f64)> {
        let stated = parts(name).1;
        let Some(asked) = &self.force_unit else {
            return stated.ok_or_else(|| {
                Error::input(place, format!("the unit of the column {name}"))
                    .found("none")
                    .hint("say it: --force-unit N, kN or lbf; or write it into the name, as Force [kN]")
            });
        };
        let known = FORCE_UNITS.map(|(u, _)| u);
        let asked = newtons(asked).ok_or_else(|| Error::one_of("--force-unit", known, asked))?;
        match stated.filter(|stated| *stated != asked) {
            Some((stated, _)) => Err(Error::input(
                "--force-unit",
                format!("{stated}, as the column says"),
            )
            .found(asked.0)),
            None => Ok(asked),
        }
    }

    fn matched(
        &self,
        file: &MachineFile,
        force: usize,
        steps: &[PathBuf],
        place: &str,
    ) -> Result<(StepRows, String)> {
        if self.force_offset.is_none()
            && let Some(found) = by_name(file, steps)
        {
            return Ok((found, "matched by the pictures' names".into()));
        }
        if self.force_offset.is_none()
            && let Some(found) = by_time(file, steps, place)?
        {
            return Ok((
                found,
                "interpolated over time at the times of the pictures".into(),
            ));
        }
        if let Some(column) = number_column(file, force) {
            return self.by_number(file, column, steps, place);
        }
        let order = |first: usize| (first..file.rows.len()).map(|r| vec![(r, 1.0)]).collect();
        let (rows, count) = (file.rows.len(), steps.len());
        if rows == count {
            let found = StepRows {
                steps: order(0),
                reference: None,
            };
            return Ok((found, "matched by their order, a row a step".into()));
        }
        if rows == count + 1 {
            let found = StepRows {
                steps: order(1),
                reference: Some(vec![(0, 1.0)]),
            };
            return Ok((
                found,
                "matched by their order, the first row that of the reference picture".into(),
            ));
        }
        Err(Error::input(place, "a column with the number or the name of each picture")
            .found(format!("{} rows for {count} steps, of {}", rows, file.names.join(", ")))
            .hint("export the forces with the pictures' numbers, or leave a row for each step and one before them for the reference picture"))
    }

    fn by_number(
        &self,
        file: &MachineFile,
        column: usize,
        steps: &[PathBuf],
        place: &str,
    ) -> Result<(StepRows, String)> {
        let mut rows: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for row in 0..file.rows.len() {
            if let Some(n) = file.number(row, column).filter(|n| n.fract() == 0.0) {
                rows.entry(n as i64).or_default().push(row);
            }
        }
        let offset = self.force_offset.unwrap_or(0);
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
                Error::input(place, format!("picture {wanted}, of {}", step.display()))
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
        Ok((
            StepRows {
                steps: of_steps,
                reference,
            },
            how,
        ))
    }
}

/// Rows of a file by what they are of, each with its share in the force.
struct StepRows {
    steps: Vec<Vec<(usize, f64)>>,
    reference: Option<Vec<(usize, f64)>>,
}

/// Rows of equal shares.
fn alike(rows: Vec<usize>) -> Vec<(usize, f64)> {
    let share = 1.0 / rows.len().max(1) as f64;
    rows.into_iter().map(|row| (row, share)).collect()
}

/// What columns of times are called.
const TIMES: [&str; 7] = ["time", "zeit", "temps", "tiempo", "tempo", "elapsed", "t"];

/// By a column of times, where every step's file states when its picture was taken: in its name, a line or a column.
///
/// # Errors
/// Of the input: times outside of the record, or a record that does not go on in time.
fn by_time(file: &MachineFile, steps: &[PathBuf], place: &str) -> Result<Option<StepRows>> {
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
    let at = |(step, time): (&PathBuf, &f64)| {
        let next = record.partition_point(|(_, t)| t < time);
        let shares = match (
            next.checked_sub(1).and_then(|k| record.get(k)),
            record.get(next),
        ) {
            (_, Some((row, t))) if t == time => vec![(*row, 1.0)],
            (Some((a, from)), Some((b, to))) => {
                let share = (time - from) / (to - from);
                vec![(*a, 1.0 - share), (*b, share)]
            }
            _ => {
                let ends = record.first().zip(record.last());
                let (first, last) = ends.map_or((f64::NAN, f64::NAN), |(a, b)| (a.1, b.1));
                return Err(Error::input(
                    place,
                    format!("the force at {time} s, of {}", step.display()),
                )
                .found(format!("times {first} to {last} s"))
                .hint("do both clocks start together? shift the record's times"));
            }
        };
        Ok(shares)
    };
    let steps = steps.iter().zip(&pictures).map(at).collect::<Result<_>>()?;
    Ok(Some(StepRows {
        steps,
        reference: None,
    }))
}

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
    Some(StepRows {
        steps: found.into_iter().map(alike).collect(),
        reference,
    })
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

/// What is said of steps at one force.
fn repeats(forces: &[f64]) -> String {
    let largest = forces.iter().fold(0.0, |a: f64, f| a.max(f.abs()));
    let mut sorted = forces.to_vec();
    sorted.sort_by(f64::total_cmp);
    let alike = sorted
        .windows(2)
        .filter(|w| w[1] - w[0] <= SAME * largest)
        .count();
    match alike {
        0 => String::new(),
        _ => format!(
            "  {alike} steps are at the force of another one within 0.5 %: they are kept, as repeats\n"
        ),
    }
}

/// To six digits.
fn round(force: f64) -> f64 {
    format!("{force:.5e}").parse().unwrap_or(force)
}
