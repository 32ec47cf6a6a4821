//! `plychain build`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::folder::Folder;
use super::identify::load;
use super::{DEFAULT_MODEL, cache, print};
use crate::error::{Error, Result};
use crate::report::terminal;
use crate::trace;

/// Arguments of `build`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Measured data in place of the model's, for the window it covers
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder for reduced_model.json, which must not exist (default: the first free of runs/NAME-build, ...)
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Run the verb.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let model = load(&arguments.model, arguments.data.as_ref())?;
    let folder = Folder::create(
        arguments.out.as_deref(),
        &format!("{}-build", model.file.name),
    )?;
    let prepared = trace::prepare(&model, &cache(), console)?;
    print(&terminal::reduced_model(&prepared.reduced))?;
    let value = serde_json::to_string(&prepared.reduced)
        .map_err(|e| Error::program("reduced_model.json", "numbers that JSON can hold").found(e))?;
    folder.write("reduced_model.json", &value)?;
    print(&format!("\nwritten to {}\n", folder.path().display()))?;
    folder.keep();
    Ok(())
}
