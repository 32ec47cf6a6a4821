//! The table as `collected.csv`, `collected.zarr` and `collected.html`.

use std::path::{Path, PathBuf};

use maud::html;

use super::collected::Collected;
use super::outlying::MOST_Z;
use super::row::{Found, Row};
use crate::chain::write_table;
use crate::error::{Error, Result};
use crate::files;
use crate::quantity::significant;
use crate::report::{document, table};

/// Columns of a constant, with its number.
type Column = (&'static str, fn(&Found) -> Option<f64>);
const COLUMNS: [Column; 5] = [
    ("mean", |f| Some(f.mean)),
    ("sd", |f| Some(f.sd)),
    ("q2.5", |f| Some(f.low)),
    ("q97.5", |f| Some(f.high)),
    ("robust_z", |f| f.robust_z),
];

/// Write all of them into a folder, and return the paths.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(collected: &Collected, folder: &Path) -> Result<[PathBuf; 3]> {
    let paths = ["csv", "zarr", "html"].map(|e| folder.join(format!("collected.{e}")));
    files::replace(&paths[0], csv(collected)?)?;
    let columns = columns(collected);
    write_table(&paths[1], &names(collected), &columns)?;
    files::replace(&paths[2], page(collected))?;
    Ok(paths)
}

fn names(collected: &Collected) -> Vec<&str> {
    let rows = collected.rows.iter();
    rows.map(|r| r.entry.run.name.as_str()).collect()
}

/// Numbers of the constants by name of the column, NaN where there is none.
fn columns(collected: &Collected) -> Vec<(String, Vec<f64>)> {
    let of = |constant: &String| {
        COLUMNS.map(|(what, pick)| {
            let number = |r: &Row| r.constants.get(constant).and_then(pick);
            let numbers = collected.rows.iter().map(number);
            let numbers = numbers.map(|v| v.unwrap_or(f64::NAN)).collect();
            (format!("{constant}_{what}"), numbers)
        })
    };
    collected.constants.iter().flat_map(of).collect()
}

/// What was set in the models of any run, in order.
fn keys(collected: &Collected) -> Vec<&str> {
    let mut keys: Vec<&str> = Vec::new();
    for key in collected.rows.iter().flat_map(|r| r.entry.run.set.keys()) {
        if !keys.contains(&key.as_str()) {
            keys.push(key);
        }
    }
    keys
}

/// What is known of a run beside its constants.
const ABOUT: [&str; 8] = [
    "run",
    "state",
    "seed",
    "model",
    "data",
    "verdict",
    "effects",
    "converged",
];

fn about(row: &Row, keys: &[&str]) -> Vec<String> {
    let run = &row.entry.run;
    let set = |key: &&str| {
        run.set
            .get(*key)
            .map_or_else(String::new, ToString::to_string)
    };
    let data = run.data.as_ref().map(|d| d.display().to_string());
    let converged = row.converged.map(|c| if c { "yes" } else { "no" });
    let mut cells = vec![
        run.name.clone(),
        row.entry.status.state.words().into(),
        run.seed.to_string(),
        run.model.display().to_string(),
        data.unwrap_or_default(),
        row.verdict.clone(),
        row.effects.join(" "),
        converged.unwrap_or_default().into(),
    ];
    cells.extend(keys.iter().map(set));
    cells
}

fn csv(collected: &Collected) -> Result<Vec<u8>> {
    let failed = |e: &dyn std::fmt::Display| {
        Error::program("collected.csv", "a table that can be written").found(e)
    };
    let (keys, columns) = (keys(collected), columns(collected));
    let mut out = csv::Writer::from_writer(Vec::new());
    let header = ABOUT.iter().copied().chain(keys.iter().copied());
    let header = header.chain(columns.iter().map(|(name, _)| name.as_str()));
    out.write_record(header).map_err(|e| failed(&e))?;
    for (k, row) in collected.rows.iter().enumerate() {
        let mut cells = about(row, &keys);
        cells.extend(columns.iter().map(|(_, numbers)| match numbers[k] {
            v if v.is_nan() => String::new(),
            v => v.to_string(),
        }));
        out.write_record(cells).map_err(|e| failed(&e))?;
    }
    out.into_inner().map_err(|e| failed(&e))
}

fn page(collected: &Collected) -> String {
    let keys = keys(collected);
    let mut header = vec!["run", "state"];
    header.extend(collected.constants.iter().map(String::as_str));
    header.extend(["verdict", "effects", "converged", "seed"]);
    header.extend(&keys);
    let rows = collected.rows.iter().map(|row| {
        let [
            name,
            state,
            seed,
            _,
            _,
            verdict,
            effects,
            converged,
            set @ ..,
        ] = &about(row, &keys)[..]
        else {
            return Vec::new();
        };
        let mut cells = vec![name.clone(), state.clone()];
        cells.extend(
            collected
                .constants
                .iter()
                .map(|c| cell(row.constants.get(c))),
        );
        cells.extend([verdict, effects, converged, seed].map(Clone::clone));
        cells.extend(set.iter().cloned());
        cells
    });
    let outlying: Vec<Vec<String>> = collected
        .outlying()
        .map(|(row, name, z)| vec![row.entry.run.name.clone(), name.into(), format!("{z:.1}")])
        .collect();
    let body = html! {
        header { h1 { "Campaign " (collected.name) } p.soft { (collected.standing) } }
        main {
            section { h2 { "Runs" } (table("Mean \u{b1} sd [95 % interval]", &header, rows, true)) }
            section {
                h2 { "Outlying specimens" }
                @if outlying.is_empty() { p { "None." } }
                @else { (table("Distance from the median of the others", &["run", "constant", "robust z"], outlying, true)) }
            }
        }
        footer.soft {
            "A specimen is outlying if a constant lies more than " (MOST_Z)
            " sds from the median of the others: of their spread beyond their own uncertainty, and of its own uncertainty."
        }
    };
    document(&format!("{}: plychain campaign", collected.name), &body)
}

fn cell(found: Option<&Found>) -> String {
    let Some(f) = found else {
        return "\u{2013}".into();
    };
    let [mean, sd, low, high] = [f.mean, f.sd, f.low, f.high].map(|v| significant(v, f.sd));
    let mark = match f.robust_z {
        Some(z) if z.abs() > MOST_Z => " *",
        _ => "",
    };
    format!("{mean} \u{b1} {sd} [{low}, {high}]{mark}")
}
