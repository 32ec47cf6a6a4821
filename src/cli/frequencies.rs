//! `plychain identify` of a model whose experiments are frequencies.

use std::path::Path;

use super::console::Console;
use super::running::Running;
use super::{Global, print};
use crate::chain::write_csv;
use crate::error::Result;
use crate::files;
use crate::identify::{FrequenciesFound, identify_frequencies};
use crate::infer::FrequenciesModel;
use crate::progress::Progress;
use crate::report::frequencies::{FrequenciesReport, page};
use crate::report::manifest::KnownTruth;
use crate::report::section::terminal;

pub fn run(
    model: &FrequenciesModel,
    running: &Running,
    global: &Global,
    console: &Console,
) -> Result<()> {
    let plan = running.plan_of_plates(model, global)?;
    let folder = &plan.folder;
    let found = identify_frequencies(model, &plan.options(folder.path()), console)?;
    console.begin("report and figures", None);
    let report = write(model, &found, folder.path())?;
    folder.write_manifest(&model.path, &[], global.seed)?;
    console.end();
    print(&terminal(&report.sections()))?;
    let path = folder.path().display();
    print(&format!("written to {path}; open {path}/report.html\n"))?;
    plan.complete([&found.verdict])
}

/// Write what the frequencies said into a folder.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(
    model: &FrequenciesModel,
    found: &FrequenciesFound,
    place: &Path,
) -> Result<FrequenciesReport> {
    write_csv(&found.draws, &place.join("chain.csv"))?;
    files::write_json(&place.join("model.json"), &model.file)?;
    let report = FrequenciesReport::new(model, found);
    files::write_json(&place.join("report.json"), &report)?;
    let truth = model.path.parent().map_or(Ok(None), KnownTruth::load)?;
    let page = page(&report, found, truth.as_ref())?;
    files::replace(&place.join("report.html"), page)?;
    Ok(report)
}
