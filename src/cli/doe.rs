//! `plychain design-of-experiments`.

use std::path::PathBuf;

use clap::Args;

use super::{DEFAULT_MODEL, print};
use crate::error::{Error, Result};
use crate::files;
use crate::infer::{Model, box_to_solve};
use crate::reduce::{doe_text, rows_to_solve};
use crate::section::{Section, Table, TableCell, row, terminal};

/// Arguments of `design-of-experiments`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain design-of-experiments model.json --out doe.csv
then solve every row, write fields/1.csv, fields/2.csv, ... (x_mm,y_mm,ux_mm,uy_mm at nodes), and declare
  \"reduced_model\": { \"snapshots\": { \"doe\": \"doe.csv\", \"fields\": \"fields/*.csv\" }, ... }")]
pub struct DoeArguments {
    /// Model file; its measurement is not needed
    #[arg(default_value = DEFAULT_MODEL)]
    pub(super) model: PathBuf,
    /// Table to write, which must not exist. Its columns: row, the constants, and the thickness if it has an sd
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Number of rows, 10 to 5000 (default: the model's number of snapshots)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(10..=5000))]
    snapshots: Option<u32>,
}

pub fn run(arguments: &DoeArguments) -> Result<()> {
    let model = Model::load(&arguments.model)?;
    let sides = box_to_solve(&model)?;
    let own = model.file.reduced_model.count();
    let count = arguments.snapshots.map_or(own, |n| n as usize);
    let rows = rows_to_solve(&sides, count);
    if arguments.out.exists() {
        let place = format!("--out {}", arguments.out.display());
        return Err(Error::input(place, "a file that does not exist yet").found("one"));
    }
    files::replace(&arguments.out, doe_text(&sides, &rows))?;
    let rows = sides.iter().map(|side| {
        let ends = [side.low, side.high].map(|v| TableCell::fixed(v, 4));
        row(&side.name, ends)
    });
    let section = Section::new(format!("{count} rows in {}", arguments.out.display()));
    print(&terminal(&[section.with(Table::new(
        "",
        ["", "low", "high"],
        rows,
    ))]))
}
