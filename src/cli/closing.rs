//! `plychain loop` and `plychain trace`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::console::Console;
use super::folder::check_run;
use super::running::{RunPlan, Running};
use super::{Global, field_run, print, results, study};
use crate::chain::check_stores;
use crate::error::{Error, Result};
use crate::files;
use crate::infer::Model;
use crate::report::json::Keyed;
use crate::report::learned::learned;
use crate::report::round::MeanAndSd;
use crate::report::study::StudyReport;
use crate::report::{Page, Report, run as sections_of, traced};
use crate::section::{Section, terminal};
use crate::study::Study;
use crate::trace::{self, LoopStage, Suspect};

/// Arguments of `loop`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain loop                                    models/openhole.json and its sample measurement
  plychain loop specimen.json --out runs/first
  plychain loop specimen.json --out runs/first --resume    go on with an interrupted loop")]
pub struct LoopArguments {
    #[command(flatten)]
    pub(super) running: Running,
    /// Maximum number of attempts to add an effect, 0 to 20
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(0..=20))]
    rounds: u8,
    /// Print the time of each stage, seconds: elapsed, and of all processors
    #[arg(long)]
    timings: bool,
}

pub fn close(arguments: &LoopArguments, global: &Global, console: &Console) -> Result<()> {
    let run = arguments.running.plan(global)?;
    let closed = close_all(run, usize::from(arguments.rounds), console);
    if arguments.timings {
        let table = sections_of::timings(&console.costs());
        print(&terminal(&[Section::default().with(table)]))?;
    }
    closed
}

fn close_all(run: RunPlan, most: usize, console: &Console) -> Result<()> {
    if run.is_done()? {
        return done(run);
    }
    let [experiment] = &run.study.experiments[..] else {
        return study::close(run, most, console);
    };
    let Some(model) = experiment.field().cloned() else {
        return study::close(run, most, console);
    };
    console.expect_loops(1);
    let options =
        |stage: LoopStage| match (stage, field_run::stage_folder(run.folder.path(), stage)) {
            (LoopStage::Attempt(0), place) => run.doubting(&place),
            (_, place) => run.options(&place),
        };
    let closed = trace::close(&model, most, &options, console)?;
    let folder = run.folder.path();
    let page = field_run::write_closed((&run, folder, console), &Model::resolved, (&closed, None))?;
    field_run::say((&closed, &page), &run, console)?;
    let verdicts = closed.rounds.iter().map(|s| &s.identification.verdict);
    run.finish(&page, verdicts, console)
}

/// Print what a finished loop found, from its files.
fn done(run: RunPlan) -> Result<()> {
    check_stores(run.folder.path())?;
    let mut pages = Vec::new();
    for (k, _) in run.study.fields() {
        pages.push(Page::load(&field_run::folder_of(
            run.folder.path(),
            &run.study,
            k,
        ))?);
    }
    for page in &pages {
        field_run::show(page, run.verbose)?;
    }
    if pages.is_empty() {
        let report = StudyReport::load(run.folder.path())?;
        results(&report)?;
        print(&terminal(&report.sections()))?;
        return run.done([]);
    }
    let rounds = pages.iter().flat_map(|page| &page.report.rounds);
    run.done(rounds.map(|round| &round.convergence))
}

/// Arguments of `trace`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain trace runs/openhole")]
pub struct TraceArguments {
    /// Folder of a finished run
    run: PathBuf,
}

/// Run `trace`: the ranking of effects in every field, without sampling again.
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
    let study = study.settled()?;
    let fields: Vec<(usize, Model)> = study.fields().map(|(k, m)| (k, m.clone())).collect();
    let several = fields.len() > 1;
    let mut all = Keyed::new();
    for (k, mut model) in fields {
        let place = field_run::folder_of(run, &study, k);
        check_run(run, &model)?;
        study::know(run, &study, &mut model)?;
        let name = model.experiment().name.clone();
        if several {
            print(&format!("{name}\n\n"))?;
        }
        let (path, value) = traced_field(&place, &model, console)?;
        print(&format!("written to {}\n", path.display()))?;
        all.insert(name, value);
    }
    match all.first() {
        None => {
            let wanted = "the run of a field to trace effects in";
            Err(Error::input(run.display(), wanted).found("none"))
        }
        Some((_, value)) if !several => results(value),
        Some(_) => results(&all),
    }
}

/// Trace what is left of a field whose results are in a folder: the file that says so, and what it holds.
fn traced_field(place: &Path, model: &Model, console: &Console) -> Result<(PathBuf, Value)> {
    let alone = alone(place, model)?;
    let prepared = crate::identify::prepare(model, console)?;
    let inverse = crate::identify::inverse_problem(model, prepared, console)?;
    let (tracing, _) = trace::attribute(model, &inverse, &|_| true, console)?;
    let (found, spots) = (traced::tracing(&tracing), &tracing.blind_spots);
    let suspect = Some(&tracing.suspect).filter(|s| !s.reasons.is_empty());
    let quoted = suspect.map_or_else(|| tracing.averaged.clone(), Suspect::hull);
    let by_name = quoted.iter();
    let by_name = by_name.map(|(name, i)| (name.clone(), (i.mean, i.sd).into()));
    let learned = learned(model, &by_name.collect());
    let averaged = sections_of::averaged(&found, &quoted, suspect, spots, (&alone, &learned));
    print(&terminal(&[sections_of::tracing(&found)]))?;
    print(&terminal(&averaged))?;
    let path = place.join("trace.json");
    let value = traced::trace_file(&tracing, &found);
    files::write_json(&path, &value)?;
    Ok((path, value))
}

/// Mean and sd of the constants by the last round in `report.json`.
fn alone(run: &Path, model: &Model) -> Result<Keyed<MeanAndSd>> {
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
    Ok(round.alone())
}
