//! `plychain identify`.

use clap::Args;

use super::console::Console;
use super::running::Running;
use super::{Global, field_run, study};
use crate::error::Result;
use crate::identify;

/// Arguments of `identify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain identify
  plychain identify specimen.json --data other.csv --strict
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
    run.table(&rounds[0].draws, run.folder.path())?;
    let page = field_run::write_identified(&model, &rounds, &run.folder, run.seed())?;
    field_run::show(&page, run.verbose)?;
    run.finish(&page, rounds.iter().map(|r| &r.verdict), console)
}
