//! `plychain build`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::folder::Folder;
use super::{DEFAULT_MODEL, print, results};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::fem::Certificate;
use crate::identify::{self, Prepared};
use crate::infer::Model;
use crate::progress::Progress;
use crate::reduce::{ReducedModel, spread_over};
use crate::report::tables;
use crate::section::terminal;

/// Arguments of `build`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain build models/openhole.json")]
pub struct BuildArguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    pub(super) model: PathBuf,
    /// Measured data in place of the model's, a folder or a CSV file
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder for reduced_model.json, which must not exist (default: the first free of runs/NAME-build, ...)
    #[arg(long)]
    out: Option<PathBuf>,
}

/// The schema of `reduced_model.json`: `tables` (error tables by name), `reduced_basis`, `model` (the reduced model itself).
const SCHEMA: &str = "plychain-reduced-model/1";

pub fn run(arguments: &BuildArguments, console: &Console) -> Result<()> {
    let model = Model::load_with(&arguments.model, arguments.data.as_ref())?;
    let folder = Folder::create(
        arguments.out.as_deref(),
        &format!("{}-build", model.file.name),
    )?;
    let prepared = identify::prepare(&model, console)?;
    let reduced = ReducedModel::of(&prepared.problem, console)?;
    print(&terminal(&tables::sections(&reduced)))?;
    let certificates = certify(&prepared, console)?;
    if prepared.problem.experiment.given().is_none() {
        print(&terminal(&[tables::basis_section(&certificates)]))?;
    }
    let mut value = json!({
        "schema": SCHEMA,
        "tables": tables::numbers(&reduced),
        "reduced_basis": tables::basis_numbers(&certificates),
    });
    results(&value)?;
    value["model"] = serde_json::to_value(&reduced)
        .map_err(|e| Error::program("reduced_model.json", "numbers that JSON can hold").found(e))?;
    folder.write_json("reduced_model.json", &value)?;
    print(&format!("\nwritten to {}\n", folder.path().display()))?;
    folder.keep();
    Ok(())
}

/// Points of the box at which a reduced basis is held against the solver.
const COMPARED: usize = 20;

/// Seed of those points, none of which the basis was made for.
const POINTS_SEED: u64 = 16;

/// The reduced basis beside the solver at random points of the box.
fn certify(prepared: &Prepared, console: &Console) -> Result<Vec<Certificate>> {
    console.begin("reduced basis against the finite elements", None);
    let problem = &prepared.problem;
    let points = spread_over(problem, COMPARED, POINTS_SEED);
    let states: Vec<State> = points.iter().map(|p| problem.state(p)).collect();
    let sight = &prepared.observation.sight;
    let certificates = problem.experiment.certify(&states, sight)?;
    console.end();
    Ok(certificates)
}
