//! `plychain identify` of a model whose experiments are frequencies.

use super::console::Console;
use super::running::Running;
use super::{Global, print};
use crate::chain::write_csv;
use crate::error::Result;
use crate::files;
use crate::identify::identify_ringing;
use crate::infer::RingingModel;
use crate::progress::Progress;
use crate::report::manifest::KnownTruth;
use crate::report::ringing::{RingingReport, page};

pub fn run(
    model: &RingingModel,
    running: &Running,
    global: &Global,
    console: &Console,
) -> Result<()> {
    let plan = running.plan_of_plates(model, global)?;
    let folder = &plan.folder;
    let found = identify_ringing(model, &plan.options(folder.path()), console)?;
    write_csv(&found.draws, &folder.path().join("chain.csv"))?;
    folder.write_json("model.json", &model.file)?;
    let report = RingingReport::new(model, &found);
    folder.write_json("report.json", &report)?;
    folder.write_manifest(&model.path, &[], global.seed)?;
    print(&report.text())?;
    console.begin("report and figures", None);
    let truth = model.path.parent().map_or(Ok(None), KnownTruth::load)?;
    files::replace(
        &folder.path().join("report.html"),
        page(&report, &found, truth.as_ref())?,
    )?;
    console.end();
    let path = folder.path().display();
    print(&format!("written to {path}; open {path}/report.html\n"))?;
    plan.folder.keep();
    running.judge([&found.verdict])
}
