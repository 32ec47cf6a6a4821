//! `init --forces`: the force of every step, from the testing machine's file.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::force_rows::{ForceRecord, parts};
use super::machine_file::MachineFile;
use crate::error::{Error, Result};
use crate::field::programs::{FORCE_UNITS, newtons};

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

/// Forces of two steps this close, as a share of the largest, are of one load.
const SAME: f64 = 5e-3;

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
        let record = ForceRecord {
            file: &file,
            force: column,
            offset: self.force_offset,
            place: &place,
        };
        let rows = record.rows(steps)?;
        let how = &rows.how;
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
        for (step, own) in steps.iter().zip(&rows.steps) {
            let force = round(of(&step.display().to_string(), own)? - reference);
            let more = match own.len() {
                1 => String::new(),
                _ if rows.is_interpolated => " and the next".into(),
                count => format!(", the mean of {count} rows"),
            };
            let line = own.first().map_or(0, |r| file.rows[r.0].0);
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
