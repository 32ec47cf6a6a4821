//! `plychain loop` and `plychain trace`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::console::{Console, line};
use super::folder::{AVERAGED, check_run};
use super::identify::truth;
use super::running::{RunPlan, Running};
use super::{Global, cache, print, study};
use crate::chain::{write_csv, write_zarr};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::files;
use crate::infer::Model;
use crate::report::json::Keyed;
use crate::report::round::MeanAndSd;
use crate::report::together::TogetherReport;
use crate::report::{Page, Report, gather, ranking, terminal, traced};
use crate::study::Study;
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

pub fn close(arguments: &LoopArguments, global: &Global, console: &Console) -> Result<()> {
    let run = arguments.running.plan(global)?;
    let most = usize::from(arguments.rounds);
    let [experiment] = &run.study.experiments[..] else {
        return study::close(run, most, console);
    };
    let Some(model) = experiment.field().cloned() else {
        return study::close(run, most, console);
    };
    let options = |stage: LoopStage| run.options(&place(run.folder.path(), stage));
    let closed = trace::close(&model, most, &options, console)?;
    let folder = (&run, run.folder.path());
    let page = write(folder, &Model::resolved, (&closed, None))?;
    say(&closed, &page)?;
    let verdicts = closed.rounds.iter().map(|s| &s.identification.verdict);
    run.finish(&page, verdicts, console)
}

/// Print what a loop found.
pub(super) fn say(closed: &Closed, page: &Page) -> Result<()> {
    if let ToQuote::ClosedForm(why) = &closed.to_quote {
        // the verdict stands
        line(&format!(
            "  the intervals to quote are those of the closed form: {why}"
        ));
    }
    let report = &page.report;
    if let (Some(last), Some(closing)) = (report.last(), &report.closing) {
        print(&terminal::identification(&report.model, last))?;
        print(&ranking::closed(page, closing))?;
    }
    print(&report.together_text())
}

/// Where the chains of a stage are kept: those of the first round in the folder itself.
pub(super) fn place(folder: &Path, stage: LoopStage) -> PathBuf {
    match stage {
        LoopStage::Attempt(0) => folder.to_path_buf(),
        LoopStage::Attempt(attempt) => folder.join(format!("round-{attempt}")),
        LoopStage::Answer(supposing) => folder.join(AVERAGED).join(supposing.key()),
    }
}

/// Write what a loop over a field leaves behind beside its chain stores into a folder of the run, and return the page that shows it, which
/// is still to be written; `whole` is the model file with a model of the field.
pub(super) fn write(
    (run, folder): (&RunPlan, &Path),
    whole: &dyn Fn(&Model) -> Result<Value>,
    (closed, together): (&Closed, Option<TogetherReport>),
) -> Result<Page> {
    for round in &closed.rounds {
        let place = place(folder, LoopStage::Attempt(round.attempt));
        write_csv(&round.identification.draws, &place.join("chain.csv"))?;
        files::write_json(&place.join("model.json"), &whole(&round.model)?)?;
    }
    if let ToQuote::Sampled(sampled) = &closed.to_quote {
        let place = folder.join(AVERAGED);
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
    files::write_json(&folder.join("model.extended.json"), &whole(&last.model)?)?;
    let mut report = gather::closed(closed, run.seed());
    report.together = together;
    files::write_json(&folder.join("report.json"), &report)?;
    let files = closed.rounds[0].identification.files();
    let manifest = run
        .folder
        .write_manifest(&last.model.path, files, run.seed())?;
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
    let file = match extended.exists() {
        true => extended,
        false => run.join("model.json"),
    };
    let study = Study::load(&file).map_err(|e| {
        e.hint("give the folder of a finished run; one of another model format must be identified anew")
    })?;
    let study = study.settled(false)?;
    let field = study.fields().next().map(|(_, model)| model.clone());
    let mut model = field.ok_or_else(|| {
        Error::input(run.display(), "the run of a field to trace effects in").found("none")
    })?;
    let (start, alone) = state(run, &model)?;
    check_run(run, &model)?;
    study::know(run, &study, &mut model)?;
    let prepared = crate::identify::prepare(&model, &cache(), console)?;
    let (tracing, _) = trace::attribute(&model, &prepared, start, &|_| true, console)?;
    let (found, spots) = (traced::tracing(&tracing), traced::blind_spots(&tracing));
    print(&ranking::tracing(&found))?;
    let suspect = Some(&tracing.suspect).filter(|s| !s.reasons.is_empty());
    let quoted = suspect.map_or_else(|| tracing.averaged.clone(), Suspect::hull);
    print(&ranking::averaged(&found, &quoted, suspect, &spots, &alone))?;
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
