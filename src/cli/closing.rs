//! `plychain loop` and `plychain trace`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::console::Console;
use super::folder::{Folder, check_run};
use super::identify::{resolved, truth};
use super::running::Running;
use super::{Global, cache, print};
use crate::chain::write_csv;
use crate::error::{Error, Result};
use crate::experiment::State;
use crate::files;
use crate::infer::Model;
use crate::progress::Progress;
use crate::report::{Alone, Page, numbers, ranking, terminal, traced};
use crate::trace::{self, Closed};

/// Arguments of `loop`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain loop                                    models/openhole.json and its sample measurement
  plychain loop specimen.json --out runs/first --png
  plychain loop specimen.json --out runs/first --resume    go on with an interrupted loop")]
pub struct LoopArguments {
    #[command(flatten)]
    running: Running,
    /// Most effects that are added, one a round
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(0..=20))]
    rounds: u8,
}

/// Run `loop`.
pub fn close(arguments: &LoopArguments, global: &Global, console: &Console) -> Result<()> {
    let running = &arguments.running;
    let plan = running.plan(global)?;
    let options = |round: usize| plan.options(&place(plan.folder.path(), round));
    let most = usize::from(arguments.rounds);
    let closed = trace::close(&plan.model, most, &options, console)?;
    let page = write(&plan.folder, &plan.model, &closed, global.seed)?;
    let last = &closed.rounds[closed.rounds.len() - 1];
    print(&terminal::identification(&last.model, &last.identification))?;
    print(&ranking::closed(&closed))?;
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

fn write(folder: &Folder, model: &Model, closed: &Closed, seed: u64) -> Result<Page> {
    for (k, step) in closed.rounds.iter().enumerate() {
        let place = place(folder.path(), k);
        write_csv(&step.identification.draws, &place.join("chain.csv"))?;
        let name = if k == 0 {
            "model.json".to_string()
        } else {
            format!("round-{k}/model.json")
        };
        folder.write_json(&name, &resolved(&step.model)?)?;
    }
    let last = &closed.rounds[closed.rounds.len() - 1];
    folder.write_json("model.extended.json", &resolved(&last.model)?)?;
    let report = traced::report(closed, seed);
    folder.write_json("report.json", &report)?;
    let files = &closed.rounds[0]
        .identification
        .inverse
        .prepared
        .observation
        .field
        .files;
    let manifest = folder.write_manifest(model, files, seed)?;
    let rounds: Vec<_> = closed.rounds.iter().map(|s| &s.identification).collect();
    Ok(Page::gather(&rounds, report, manifest, truth(files)?))
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
    let model = if extended.exists() {
        Model::load(&extended)
    } else {
        Model::load(&run.join("model.json"))
    }
    .map_err(|e| e.hint("give the folder of a finished run; one of another model format must be identified anew"))?;
    let (start, alone) = state(run, &model)?;
    check_run(run, &model)?;
    let prepared = crate::identify::prepare(&model, &cache(), console)?;
    let tracing = trace::attribute(&model, &prepared, start, console)?;
    print(&ranking::tracing(&tracing))?;
    print(&ranking::averaged(&tracing, &alone))?;
    let path = arguments.run.join("trace.json");
    let mut text = serde_json::to_string_pretty(&traced::traced(&tracing))
        .map_err(|e| Error::program("trace.json", "numbers that JSON can hold").found(e))?;
    text.push('\n');
    files::replace(&path, text)?;
    print(&format!("written to {}\n", path.display()))
}

/// Posterior means of the last round in `report.json`, and mean and sd of the constants.
fn state(run: &Path, model: &Model) -> Result<(State, Alone)> {
    let path = run.join("report.json");
    let wanted = || Error::input(path.display(), "the report of a finished run");
    let text = std::fs::read_to_string(&path).map_err(|e| wanted().found(e))?;
    let report: Value = serde_json::from_str(&text).map_err(|e| wanted().found(e))?;
    let round = report["rounds"]
        .as_array()
        .and_then(|rounds| rounds.last())
        .ok_or_else(|| wanted().found("no rounds"))?;
    let mismatch = |found: String| {
        wanted()
            .found(found)
            .hint("the folder's model and report do not belong together: identify anew")
    };
    if report["schema"] != numbers::SCHEMA {
        return Err(wanted().found(&report["schema"]).hint(format!(
            "this program reads {}: identify anew",
            numbers::SCHEMA
        )));
    }
    let declared: Vec<&str> = round["effects_declared"]
        .as_array()
        .map_or_else(Vec::new, |names| {
            names.iter().filter_map(Value::as_str).collect()
        });
    let own: Vec<&str> = model.effects.iter().map(|e| e.name()).collect();
    if declared != own {
        return Err(mismatch(format!(
            "the effects {}, and a model with {}",
            declared.join(", "),
            own.join(", ")
        )));
    }
    let mean = |name: &str| {
        let of = |part: &str| round[part][name]["mean"].as_f64();
        of("posterior").or_else(|| of("effect_amplitudes"))
    };
    let mut alone = Alone::new();
    for name in model.constants() {
        let sd = round["posterior"][name]["sd"].as_f64();
        if let Some(moments) = mean(name).zip(sd) {
            alone.push(((*name).to_string(), moments));
        } else {
            return Err(mismatch(format!("no posterior of {name}")));
        }
    }
    Ok((model.state(&mean), alone))
}
