//! `plychain identify`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::folder::Folder;
use super::running::Running;
use super::{Global, closing, study};
use crate::chain::write_csv;
use crate::error::Result;
use crate::identify::{self, Identification};
use crate::infer::Model;
use crate::report::manifest::KnownTruth;
use crate::report::{Page, gather};

/// Arguments of `identify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain identify
  plychain identify specimen.json --data other.csv --refine --strict
  plychain identify specimen.json --out runs/long --resume    go on with an interrupted run")]
pub struct IdentifyArguments {
    #[command(flatten)]
    pub(super) running: Running,
}

pub fn run(arguments: &IdentifyArguments, global: &Global, console: &Console) -> Result<()> {
    let running = &arguments.running;
    let run = running.plan(global)?;
    let [experiment] = &run.study.experiments[..] else {
        return study::identify(run, console);
    };
    let Some(model) = experiment.field().cloned() else {
        return study::identify(run, console);
    };
    let options = run.doubting(run.folder.path());
    let rounds = [identify::identify(&model, &options, console)?];
    let page = write(&model, &rounds, &run.folder, run.seed())?;
    closing::show(&page, run.verbose)?;
    run.finish(&page, rounds.iter().map(|r| &r.verdict), console)
}

/// What `truth.json` beside simulated data says; `None` for measured data.
///
/// # Errors
/// The input's fault if the file is there and is no JSON.
pub fn truth(files: &[PathBuf]) -> Result<Option<KnownTruth>> {
    let beside = files.first().and_then(|f| f.parent());
    beside.map_or(Ok(None), KnownTruth::load)
}

/// Write what a run leaves behind beside its chain store, and return the page that shows it, which is still to be written.
pub fn write(model: &Model, rounds: &[Identification], folder: &Folder, seed: u64) -> Result<Page> {
    if let Some(round) = rounds.last() {
        write_csv(&round.draws, &folder.path().join("chain.csv"))?;
    }
    folder.write_json("model.json", &model.resolved()?)?;
    let report = gather::identified(model, rounds, seed);
    folder.write_json("report.json", &report)?;
    let files = rounds.last().map(Identification::files).unwrap_or_default();
    let manifest = folder.manifest(Some(&model.path), files, seed, Vec::new())?;
    Ok(Page::gather(rounds, report, manifest, truth(files)?))
}
