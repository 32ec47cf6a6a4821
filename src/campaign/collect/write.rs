//! The table as `collected.csv` and `collected.html`.

use std::path::{Path, PathBuf};

use indexmap::IndexSet;

use super::collected::Collected;
use super::outlying::MOST_Z;
use super::row::{CampaignRow, Found};
use crate::error::Result;
use crate::files;
use crate::report::html;
use crate::report::learned::Learned;
use crate::section::{Digits, Document, Piece, Section, Table, TableCell, csv, row};

/// Columns of a constant, with its number.
type NumberOfConstant = (&'static str, fn(&Found) -> Option<f64>);
const COLUMNS: [NumberOfConstant; 8] = [
    ("mean", |f| Some(f.mean)),
    ("sd", |f| Some(f.sd)),
    ("q2.5", |f| Some(f.low)),
    ("q97.5", |f| Some(f.high)),
    ("robust_z", |f| f.robust_z),
    ("prior_mean", |f| Some(f.learned?.prior.mean)),
    ("prior_sd", |f| Some(f.learned?.prior.sd)),
    ("from_data", |f| Some(f.learned?.from_data)),
];

/// Write both into a folder, and return the paths.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(collected: &Collected, folder: &Path) -> Result<[PathBuf; 2]> {
    let paths = ["csv", "html"].map(|e| folder.join(format!("collected.{e}")));
    let columns = columns(collected);
    files::replace(&paths[0], csv(&whole(collected, &columns))?)?;
    files::replace(&paths[1], html(&page(collected), &[]))?;
    Ok(paths)
}

/// Numbers of the constants by name of the column, NaN where there is none.
fn columns(collected: &Collected) -> Vec<(String, Vec<f64>)> {
    let columns_of = |constant: &String| {
        COLUMNS.map(|(what, pick)| {
            let number = |r: &CampaignRow| r.constants.get(constant).and_then(pick);
            let numbers = collected.rows.iter().map(number);
            let numbers = numbers.map(|v| v.unwrap_or(f64::NAN)).collect();
            (format!("{constant}_{what}"), numbers)
        })
    };
    collected.constants.iter().flat_map(columns_of).collect()
}

/// What was set in the models of any run, in order.
fn keys(collected: &Collected) -> IndexSet<&str> {
    let keys = collected.rows.iter().flat_map(|r| r.entry.run.set.keys());
    keys.map(String::as_str).collect()
}

/// What was set in the model of a run.
fn set(line: &CampaignRow, keys: &IndexSet<&str>) -> Vec<TableCell> {
    let text = |key: &&str| line.entry.run.set.get(*key).map(ToString::to_string);
    keys.iter()
        .map(|key| text(key).unwrap_or_default().into())
        .collect()
}

fn converged(line: &CampaignRow) -> TableCell {
    line.converged.map_or_else(|| "".into(), TableCell::yes)
}

/// Everything of every run, a number a column.
fn whole(collected: &Collected, columns: &[(String, Vec<f64>)]) -> Table {
    let keys = keys(collected);
    let header = [
        "run",
        "state",
        "seed",
        "model",
        "data",
        "verdict",
        "effects",
        "converged",
        "warnings",
    ];
    let header = header.into_iter().chain(keys.iter().copied());
    let header = header.chain(columns.iter().map(|(name, _)| name.as_str()));
    let rows = collected.rows.iter().enumerate().map(|(k, line)| {
        let run = &line.entry.run;
        let data = run.data.as_ref().map(|d| d.display().to_string());
        let about = [
            line.entry.status.state.words().into(),
            run.seed.to_string().into(),
            run.model.display().to_string().into(),
            data.unwrap_or_default().into(),
            TableCell::from(&line.verdict),
            line.effects.join(" ").into(),
            converged(line),
            line.warnings.join(" | ").into(),
        ];
        let numbers = columns
            .iter()
            .map(|(_, numbers)| TableCell::number(numbers[k], Digits::Whole));
        row(
            &run.name,
            about.into_iter().chain(set(line, &keys)).chain(numbers),
        )
    });
    Table::new("", header, rows)
}

fn page(collected: &Collected) -> Document {
    let keys = keys(collected);
    let header = ["run", "state"].into_iter();
    let header = header.chain(collected.constants.iter().map(String::as_str));
    let header = header.chain(["verdict", "effects", "converged", "seed"]);
    let rows = collected.rows.iter().map(|line| {
        let run = &line.entry.run;
        let constants = collected
            .constants
            .iter()
            .map(|c| constant(line.constants.get(c)));
        let about = [
            TableCell::from(&line.verdict),
            line.effects.join(" ").into(),
            converged(line),
            run.seed.to_string().into(),
        ];
        let state = TableCell::from(line.entry.status.state.words());
        let cells = std::iter::once(state).chain(constants).chain(about);
        row(&run.name, cells.chain(set(line, &keys)))
    });
    let runs = Table::new(
        "Mean +- sd [95 % interval]",
        header.chain(keys.iter().copied()),
        rows,
    );
    let warned = collected.rows.iter().flat_map(|line| {
        let name = &line.entry.run.name;
        line.warnings.iter().map(move |w| (name.clone(), w.clone()))
    });
    let warnings = Piece::List(warned.collect());
    let outlying = collected
        .outlying()
        .map(|(line, name, z)| row(&line.entry.run.name, [name.into(), TableCell::fixed(z, 1)]));
    let header = ["run", "constant", "robust z"];
    let outlying = Table::new("Distance from the median of the others", header, outlying);
    let outlying = match outlying.is_empty() {
        true => Piece::Paragraph("None.".into()),
        false => outlying.sortable().into(),
    };
    Document {
        title: format!("{}: plychain campaign", collected.name),
        heading: format!("Campaign {}", collected.name),
        lead: vec![Piece::Note(collected.standing.clone())],
        sections: vec![
            Section::new("Runs").with(runs.sortable()),
            Section::new("Outlying specimens").with(outlying),
            Section::new("Priors").with(priors(collected)),
            Section::new("Warnings of the runs").with(warnings),
        ],
        folded: false,
        footer: format!(
            "A specimen is outlying if a constant lies more than {MOST_Z} sds from the median of the others. This sd includes the spread of the others and the specimen's own sd."
        ),
    }
}

/// The prior of each constant, and the share of its variance that the data of the runs took away: the least and the most.
fn priors(collected: &Collected) -> Table {
    let rows = collected.constants.iter().filter_map(|name| {
        let all = collected
            .rows
            .iter()
            .filter_map(|r| r.constants.get(name)?.learned);
        let all: Vec<Learned> = all.collect();
        let prior = all.first()?.prior;
        let shares = all.iter().map(|l| 100.0 * l.from_data.max(0.0));
        let [least, most] = [f64::min, f64::max].map(|of| shares.clone().reduce(of));
        let prior = TableCell::mean_sd(Some(prior));
        let share = [least, most].map(|s| TableCell::with_unit(s, Digits::Fixed(0), "%"));
        Some(row(name, std::iter::once(prior).chain(share)))
    });
    let header = ["constant", "prior", "from the data, least", "most"];
    Table::new("", header, rows)
}

/// What stands on a terminal of priors.
pub fn priors_section(collected: &Collected) -> Section {
    Section::default().with(priors(collected))
}

fn constant(found: Option<&Found>) -> TableCell {
    let Some(f) = found else {
        return TableCell::Missing;
    };
    let interval = TableCell::interval([f.mean, f.sd, f.low, f.high]);
    let interval = match f.learned {
        Some(learned) if learned.is_mostly_prior() => interval.and("mostly the prior"),
        _ => interval,
    };
    match f.robust_z {
        Some(z) if z.abs() > MOST_Z => interval.and("*"),
        _ => interval,
    }
}
