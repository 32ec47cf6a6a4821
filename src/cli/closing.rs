//! `plychain loop` and `plychain trace`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::{Console, line};
use super::folder::{AVERAGED, check_run};
use super::identify::truth;
use super::running::{RunPlan, Running};
use super::{Global, beside, cache, print};
use crate::chain::{write_csv, write_zarr};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::files;
use crate::identify::{Beside, settle_force};
use crate::infer::Model;
use crate::report::json::Keyed;
use crate::report::round::MeanAndSd;
use crate::report::section::terminal;
use crate::report::together::TogetherReport;
use crate::report::{Page, Report, gather, run as sections_of, traced};
use crate::trace::{self, Closed, LoopStage, Suspect, ToQuote};

/// Arguments of `loop`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain loop                                    models/openhole.json and its sample measurement
  plychain loop specimen.json --out runs/first
  plychain loop specimen.json --out runs/first --resume    go on with an interrupted loop")]
pub struct LoopArguments {
    #[command(flatten)]
    running: Running,
    /// Most effects that are added, one a round
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(0..=20))]
    rounds: u8,
}

/// What `loop` was asked for, settled before any work.
struct LoopPlan {
    run: RunPlan,
    /// Most effects that are added.
    most: usize,
}

impl LoopPlan {
    fn new(arguments: &LoopArguments, global: &Global) -> Result<Self> {
        let running = &arguments.running;
        if running.plates()?.is_some() {
            return Err(Error::input("MODEL", "a field to trace effects in")
                .found("frequencies alone")
                .hint("plychain identify takes them"));
        }
        Ok(Self {
            run: running.plan(global)?,
            most: usize::from(arguments.rounds),
        })
    }
}

pub fn close(arguments: &LoopArguments, global: &Global, console: &Console) -> Result<()> {
    let LoopPlan { run, most } = LoopPlan::new(arguments, global)?;
    let (model, beside) = beside::identified(&run, console)?;
    let options = |stage: LoopStage| run.options(&place(run.folder.path(), stage));
    let closed = trace::close(&model, most, &options, console)?;
    if let ToQuote::ClosedForm(why) = &closed.to_quote {
        // the verdict stands
        line(&format!(
            "  the intervals to quote are those of the closed form: {why}"
        ));
    }
    let page = write(&run, &model, &closed, beside.as_ref())?;
    let report = &page.report;
    if let (Some(last), Some(closing)) = (report.last(), &report.closing) {
        let mut sections = vec![sections_of::identification(&report.model, last)];
        sections.extend(sections_of::closed(&page, closing));
        let together = report.together.as_ref();
        sections.extend(together.map(|t| t.section(&report.both())));
        print(&terminal(&sections))?;
    }
    let verdicts = closed.rounds.iter().map(|s| &s.identification.verdict);
    run.finish(&page, verdicts, console)
}

/// Where the chains of a stage are kept: those of the first round in the run's folder itself.
fn place(folder: &Path, stage: LoopStage) -> PathBuf {
    match stage {
        LoopStage::Attempt(0) => folder.to_path_buf(),
        LoopStage::Attempt(attempt) => folder.join(format!("round-{attempt}")),
        LoopStage::Answer(supposing) => folder.join(AVERAGED).join(supposing.key()),
    }
}

/// Write what a loop leaves behind beside its chain stores, and return the page that shows it, which is still to be written.
fn write(run: &RunPlan, model: &Model, closed: &Closed, beside: Option<&Beside>) -> Result<Page> {
    let folder = &run.folder;
    for round in &closed.rounds {
        let stage = LoopStage::Attempt(round.attempt);
        let place = place(folder.path(), stage);
        write_csv(&round.identification.draws, &place.join("chain.csv"))?;
        files::write_json(&place.join("model.json"), &round.model.resolved()?)?;
    }
    if let ToQuote::Sampled(sampled) = &closed.to_quote {
        let place = folder.path().join(AVERAGED);
        let store = place.join("chain.zarr");
        // an interrupted run may have left one
        if store.exists() {
            let fail = |e| Error::input(store.display(), "a writable folder").found(e);
            std::fs::remove_dir_all(&store).map_err(fail)?;
        }
        write_zarr(&sampled.draws, &store)?;
        write_csv(&sampled.draws, &place.join("chain.csv"))?;
    }
    let last = &closed.rounds[closed.rounds.len() - 1];
    folder.write_json("model.extended.json", &last.model.resolved()?)?;
    let mut report = gather::closed(closed, run.seed());
    report.together = beside.map(|b| TogetherReport::new(b, trace::tension(last).as_ref()));
    folder.write_json("report.json", &report)?;
    let files = closed.rounds[0].identification.files();
    let manifest = folder.write_manifest(&model.path, files, run.seed())?;
    Ok(Page::closed(closed, report, manifest, truth(files)?))
}

/// Arguments of `trace`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain trace runs/openhole")]
pub struct TraceArguments {
    /// Folder of a finished run
    run: PathBuf,
}

/// Run `trace`: the ranking of effects, without sampling again.
pub fn trace(arguments: &TraceArguments, console: &Console) -> Result<()> {
    let run = &arguments.run;
    let extended = run.join("model.extended.json");
    let mut model = if extended.exists() {
        Model::load(&extended)
    } else {
        Model::load(&run.join("model.json"))
    }
    .map_err(|e| e.hint("give the folder of a finished run; one of another model format must be identified anew"))?;
    settle_force(&mut model)?;
    let (start, alone) = state(run, &model)?;
    check_run(run, &model)?;
    beside::know(run, &mut model)?;
    let prepared = crate::identify::prepare(&model, &cache(), console)?;
    let (tracing, _) = trace::attribute(&model, &prepared, start, &|_| true, console)?;
    let (found, spots) = (traced::tracing(&tracing), traced::blind_spots(&tracing));

    let suspect = Some(&tracing.suspect).filter(|s| !s.reasons.is_empty());
    let quoted = suspect.map_or_else(|| tracing.averaged.clone(), Suspect::hull);
    let averaged = sections_of::averaged(&found, &quoted, suspect, &spots, &alone);
    print(&terminal(&[sections_of::tracing(&found)]))?;
    print(&terminal(&averaged))?;
    let path = arguments.run.join("trace.json");
    files::write_json(&path, &traced::trace_file(&tracing, &found, &spots))?;
    print(&format!("written to {}\n", path.display()))
}

/// Posterior means of the last round in `report.json`, and mean and sd of the constants.
fn state(run: &Path, model: &Model) -> Result<(State, Keyed<MeanAndSd>)> {
    let report = Report::load(run)?;
    let mismatch = |found: String| {
        let path = run.join("report.json");
        Error::input(path.display(), "the report of a finished run")
            .found(found)
            .hint("the folder's model and report do not belong together: identify anew")
    };
    let round = report.last().ok_or_else(|| mismatch("no rounds".into()))?;
    let own: Vec<&str> = model.effects.iter().map(|e| e.name()).collect();
    if round.effects_declared != own {
        return Err(mismatch(format!(
            "the effects {}, and a model with {}",
            round.effects_declared.join(", "),
            own.join(", ")
        )));
    }
    if let Some(name) = model
        .constants()
        .iter()
        .find(|n| !round.posterior.contains_key(**n))
    {
        return Err(mismatch(format!("no posterior of {name}")));
    }
    let mean = |name: &str| round.moments(name).map(|(mean, _)| mean);
    Ok((model.state(&mean), round.alone()))
}
