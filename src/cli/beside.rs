//! The frequencies that stand beside a field: identified first, in a folder of their own within the run's.

use std::path::Path;

use super::console::Console;
use super::frequencies;
use super::running::RunPlan;
use crate::chain::read_zarr;
use crate::error::Result;
use crate::identify::{self, Beside};
use crate::infer::Model;

/// Where they are kept, and the field's chains without them.
const FREQUENCIES: &str = "frequencies";
const FIELD: &str = "field-alone";

/// Identify what stands beside a field; the model, which then knows it, and what was found, None where nothing stands there.
///
/// # Errors
/// Those of either identification.
pub fn identified(run: &RunPlan, console: &Console) -> Result<(Model, Option<Beside>)> {
    let place = |name: &str| run.folder.path().join(name);
    let [frequencies, field] = [FREQUENCIES, FIELD].map(|name| run.options(&place(name)));
    let mut model = run.model.clone();
    let found = identify::beside(&mut model, [&frequencies, &field], console)?;
    if let Some(beside) = &found {
        frequencies::write(&beside.model, &beside.found, &place(FREQUENCIES))?;
    }
    Ok((model, found))
}

/// Let the model of a finished run know what the frequencies beside its field said in it.
///
/// # Errors
/// Of the input: a folder without their chains.
pub fn know(run: &Path, model: &mut Model) -> Result<()> {
    if model.file.frequencies.is_empty() {
        return Ok(());
    }
    let draws = read_zarr(&run.join(FREQUENCIES).join("chain.zarr"), None)?;
    identify::know(model, &draws).map(|_| ())
}
