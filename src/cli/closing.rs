//! `plychain loop` and `plychain trace`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::{Console, line};
use super::diagnose::AVERAGED;
use super::folder::{Folder, check_run};
use super::identify::truth;
use super::running::Running;
use super::{Global, beside, cache, print};
use crate::chain::{write_csv, write_zarr};
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::files;
use crate::identify::{Beside, settle_force};
use crate::infer::Model;
use crate::progress::Progress;
use crate::report::json::Keyed;
use crate::report::round::MeanAndSd;
use crate::report::together::TogetherReport;
use crate::report::{Page, Report, gather, ranking, terminal, traced};
use crate::trace::{self, Closed, Suspect};

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
    let running = &arguments.running;
    if running.plates()?.is_some() {
        return Err(Error::input("MODEL", "a field to trace effects in")
            .found("frequencies alone")
            .hint("plychain identify takes them"));
    }
    let mut plan = running.plan(global)?;
    let beside = beside::identified(&mut plan, console)?;
    let options = |round: usize| plan.options(&place(plan.folder.path(), round));
    let most = usize::from(arguments.rounds);
    let mut closed = trace::close(&plan.model, most, &options, console)?;
    let suspect = closed.conclusion.suspect.is_some();
    let again = plan.options(plan.folder.path());
    match trace::quote(&closed.rounds, suspect, &again, console) {
        Ok(quoted) => closed.sampled = Some(quoted),
        // the verdict stands, and its intervals in closed form
        Err(e) => line(&format!(
            "  the intervals to quote are those of the closed form: {e}"
        )),
    }
    let page = write(
        &plan.folder,
        &plan.model,
        &closed,
        beside.as_ref(),
        global.seed,
    )?;
    let report = &page.report;
    if let (Some(last), Some(closing)) = (report.last(), &report.closing) {
        print(&terminal::identification(&report.model, last))?;
        print(&ranking::closed(&page, closing))?;
    }
    print(&report.together_text())?;
    console.begin("report and figures", None);
    page.write(plan.folder.path(), running.png)?;
    console.end();
    let path = plan.folder.path().display();
    print(&format!("written to {path}; open {path}/report.html\n"))?;
    plan.folder.keep();
    running.judge(closed.rounds.iter().map(|s| &s.identification.verdict))
}

/// Where the chains of a round are kept: the first in the run's folder itself.
fn place(folder: &Path, round: usize) -> PathBuf {
    if round == 0 {
        folder.to_path_buf()
    } else {
        folder.join(format!("round-{round}"))
    }
}

fn write(
    folder: &Folder,
    model: &Model,
    closed: &Closed,
    beside: Option<&Beside>,
    seed: u64,
) -> Result<Page> {
    for step in &closed.rounds {
        let k = step.attempt;
        let place = place(folder.path(), k);
        write_csv(&step.identification.draws, &place.join("chain.csv"))?;
        let name = if k == 0 {
            "model.json".to_string()
        } else {
            format!("round-{k}/model.json")
        };
        folder.write_json(&name, &step.model.resolved()?)?;
    }
    if let Some(sampled) = &closed.sampled {
        let place = folder.path().join(AVERAGED);
        // an interrupted run may have left one
        if place.exists() {
            let fail = |e| Error::input(place.display(), "a writable folder").found(e);
            std::fs::remove_dir_all(&place).map_err(fail)?;
        }
        write_zarr(&sampled.draws, &place.join("chain.zarr"))?;
        write_csv(&sampled.draws, &place.join("chain.csv"))?;
    }
    let last = &closed.rounds[closed.rounds.len() - 1];
    folder.write_json("model.extended.json", &last.model.resolved()?)?;
    let mut report = gather::closed(closed, seed);
    report.together = beside.map(|b| TogetherReport::new(b, trace::tension(last).as_ref()));
    folder.write_json("report.json", &report)?;
    let files = &closed.rounds[0]
        .identification
        .inverse
        .prepared
        .observation
        .field
        .files;
    let manifest = folder.write_manifest(&model.path, files, seed)?;
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
