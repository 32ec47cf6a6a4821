//! `plychain build`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::folder::Folder;
use super::running::load;
use super::{DEFAULT_MODEL, cache, print};
use crate::effect::Scene;
use crate::error::{Error, Result};
use crate::fem::verify::{Check, checks};
use crate::identify::{self, Prepared};
use crate::progress::Progress;
use crate::reduce::cache as reduced_models;
use crate::report::tables;

/// Arguments of `build`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain build models/openhole.json --verify")]
pub struct Arguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Measured data in place of the model's, for the window it covers
    #[arg(long)]
    data: Option<PathBuf>,
    /// Verify the finite elements against closed forms and under refinement, and print the figures
    #[arg(long)]
    verify: bool,
    /// Folder for reduced_model.json, which must not exist (default: the first free of runs/NAME-build, ...)
    #[arg(long)]
    out: Option<PathBuf>,
}

/// The schema of `reduced_model.json`: `tables` (error tables by name), `comparison` (beside published ones, where the
/// model file names a reference), `model` (the reduced model itself).
const SCHEMA: &str = "plychain-reduced-model/1";

pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let model = load(&arguments.model, arguments.data.as_ref())?;
    let folder = Folder::create(
        arguments.out.as_deref(),
        &format!("{}-build", model.file.name),
    )?;
    let prepared = identify::prepare(&model, &cache(), console)?;
    print(&tables::text(&prepared.reduced))?;
    let mut value = json!({ "schema": SCHEMA, "tables": tables::numbers(&prepared.reduced) });
    if let Some(reference) = model.file.reduced_model.reference {
        let problem = prepared.problem.of_reference(reference);
        let (built, _) = reduced_models::obtain(&problem, &cache(), console)?;
        print(&tables::comparison_text(reference, &built))?;
        value["comparison"] = tables::comparison_numbers(reference, &built);
    }
    if arguments.verify {
        let checks = verify_plate(&prepared, console)?;
        print(&tables::verification_text(&checks))?;
        value["verification"] = tables::verification_numbers(&checks);
    }
    value["model"] = serde_json::to_value(&prepared.reduced)
        .map_err(|e| Error::program("reduced_model.json", "numbers that JSON can hold").found(e))?;
    folder.write_json("reduced_model.json", &value)?;
    print(&format!("\nwritten to {}\n", folder.path().display()))?;
    folder.keep();
    Ok(())
}

/// Verification figures at the prior means, over the window that was measured.
fn verify_plate(prepared: &Prepared, console: &Console) -> Result<Vec<Check>> {
    console.begin("verifying the finite elements", None);
    let experiment = &prepared.problem.experiment;
    let Scene { setup, ply, .. } = experiment.scene();
    let [low, high] = experiment.window();
    let half = (0..2)
        .map(|k| low[k].abs().max(high[k].abs()))
        .fold(0.0, f64::max);
    let checks = checks(setup, ply, half)?;
    console.end();
    Ok(checks)
}
