//! `plychain identify`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::folder::Folder;
use super::running::Running;
use super::{Global, beside, frequencies, print};
use crate::chain::write_csv;
use crate::error::Result;
use crate::identify::{self, Beside, Identification};
use crate::infer::Model;
use crate::report::manifest::KnownTruth;
use crate::report::run::identification;
use crate::report::section::terminal;
use crate::report::together::TogetherReport;
use crate::report::{Page, gather};

/// Arguments of `identify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain identify
  plychain identify specimen.json --data other.csv --refine --strict
  plychain identify specimen.json --out runs/long --resume    go on with an interrupted run")]
pub struct IdentifyArguments {
    #[command(flatten)]
    running: Running,
}

pub fn run(arguments: &IdentifyArguments, global: &Global, console: &Console) -> Result<()> {
    let running = &arguments.running;
    if let Some(model) = running.plates()? {
        return frequencies::run(&model, running, global, console);
    }
    let run = running.plan(global)?;
    let (model, beside) = beside::identified(&run, console)?;
    let options = run.options(run.folder.path());
    let rounds = [identify::identify(&model, &options, console)?];
    let page = write(&model, &rounds, beside.as_ref(), &run.folder, run.seed())?;
    let report = &page.report;
    let sections = report.rounds.iter();
    let sections = sections.map(|round| identification(&report.model, round));
    let together = report.together.as_ref();
    let together = together.map(|t| t.section(&report.both()));
    print(&terminal(&sections.chain(together).collect::<Vec<_>>()))?;
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
pub fn write(
    model: &Model,
    rounds: &[Identification],
    beside: Option<&Beside>,
    folder: &Folder,
    seed: u64,
) -> Result<Page> {
    if let Some(round) = rounds.last() {
        write_csv(&round.draws, &folder.path().join("chain.csv"))?;
    }
    folder.write_json("model.json", &model.resolved()?)?;
    let mut report = gather::identified(model, rounds, seed);
    report.together = beside.map(|b| TogetherReport::new(b, None));
    folder.write_json("report.json", &report)?;
    let files = rounds.last().map(Identification::files).unwrap_or_default();
    let manifest = folder.write_manifest(&model.path, files, seed)?;
    let rounds: Vec<&Identification> = rounds.iter().collect();
    Ok(Page::gather(&rounds, report, manifest, truth(files)?))
}
