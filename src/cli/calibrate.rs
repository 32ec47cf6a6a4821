//! The parts of `plychain validate` that simulate: the article's setting on a twin, and calibration.

use std::path::{Path, PathBuf};

use super::console::Console;
use super::validate::Arguments;
use super::{Global, cache, print};
use crate::error::{Error, Result};
use crate::files;
use crate::identify;
use crate::infer::Model;
use crate::report::calibration::{calibration_numbers, calibration_text, loop_numbers, loop_text};
use crate::sample::Laplace;
use crate::validate::calibration::{self, Plan};
use crate::validate::grid::Grid;
use crate::validate::twin::{Truth, Twin};
use crate::validate::whole_loop::{self, LoopSummary};
use crate::validate::{article, quadrature};
use serde_json::{Value, json};

/// Noise of the article's simulated twin, nm, and points along a side.
const TWIN_NOISE_NM: f64 = 10.0;
const TWIN_GRID: usize = 121;

/// The article's setting: its specimen simulated at the means of Table 6, priors of Table 4 cut at Table 5, 0.4 % of
/// unnamed error, a grid over the cut.
pub fn article_twin(
    model: &Model,
    seed: u64,
    nodes: usize,
    console: &Console,
) -> Result<quadrature::Moments> {
    if model.constants() != article::NAMES || !model.sampled().is_empty() {
        return Err(Error::input(
            "--article",
            "a laminate without mechanical effects, as the article's",
        )
        .found(&model.file.name)
        .hint("use models/openhole.json"));
    }
    let prepared = identify::prepare(model, &cache(), console)?;
    let twin = Twin::new(model, prepared, TWIN_GRID)?;
    let truth = Truth {
        theta: article::MEAN.to_vec(),
        thickness_mm: model.experiment().specimen.thickness_mm.mean,
        additive: vec![0.0; twin.columns.effects.len()],
        noise_nm: TWIN_NOISE_NM,
    };
    let mut fields = twin.finite_elements(std::slice::from_ref(&truth), &|| ())?;
    let mut u = fields.pop().unwrap_or_default();
    for (u, e) in u.iter_mut().zip(twin.noise(TWIN_NOISE_NM, 0.0, seed)) {
        *u = [u[0] + e[0], u[1] + e[1]];
    }
    let observation = twin.observed(u);
    let noise = crate::noise::Noise::estimate(
        &observation.field,
        &twin.columns.modes,
        &twin.columns.effects,
    )?;
    let statistics = crate::infer::Statistics::new(&observation, &twin.columns, &noise)?;
    let posterior = identify::posterior(model, &twin.prepared.reduced, &statistics, &noise)?;
    let mut marginals = posterior.marginals().to_vec();
    for (m, cut) in marginals.iter_mut().zip(article::TRUNCATION) {
        m.truncate = Some(cut);
    }
    let mode: Laplace = identify::start(&posterior)?;
    let posterior = posterior.with_marginals(marginals);
    Ok(Grid::new(&posterior, &mode, &article::TRUNCATION, nodes)?.moments)
}

/// Run `--sbc --loop`.
fn calibrate_loop(
    arguments: &Arguments,
    replicates: usize,
    model: &Model,
    out: &Path,
    global: &Global,
    console: &Console,
) -> Result<()> {
    let mut all = Vec::new();
    for &correlation_mm in &arguments.correlation_mm {
        let plan = Plan {
            replicates,
            correlation_mm,
            reduced: false,
            seed: global.seed,
            grid: arguments.grid,
            share: arguments.share()?,
        };
        let what = if arguments.withheld {
            "withheld"
        } else {
            "loop"
        };
        let record = out.join(format!("sbc-{what}-{correlation_mm}mm.jsonl"));
        let withheld = arguments.withheld;
        let found = whole_loop::calibrate_loop(model, &plan, withheld, &cache(), &record, console)?;
        if plan.share.is_some() {
            say_share(&plan, found.len())?;
            continue;
        }
        let summary = LoopSummary::new(model, &plan, withheld, &found);
        print(&loop_text(&summary))?;
        all.push(loop_numbers(&summary));
    }
    finish(out, "calibration_of_the_loop", all)
}

/// Run `--sbc`.
pub fn calibrate(
    arguments: &Arguments,
    replicates: usize,
    model: &Model,
    global: &Global,
    console: &Console,
) -> Result<()> {
    for l in &arguments.correlation_mm {
        if !(0.0..=2.0).contains(l) {
            return Err(Error::input(
                "--correlation-mm",
                "lengths from 0 to 2 mm, which count as noise",
            )
            .found(l));
        }
    }
    let model = calibration::model_of(model);
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(super::RUNS).join(format!("{}-sbc", model.file.name)));
    std::fs::create_dir_all(&out).map_err(|e| {
        Error::input(
            format!("--out {}", out.display()),
            "a place that can be written",
        )
        .found(e)
    })?;
    if arguments.whole_loop {
        return calibrate_loop(arguments, replicates, &model, &out, global, console);
    }
    let prepared = identify::prepare(&model, &cache(), console)?;
    let twin = Twin::new(&model, prepared, arguments.grid)?;
    let mut names: Vec<String> = model.constants().iter().map(|n| (*n).to_string()).collect();
    for effect in model.sampled() {
        names.extend(
            effect
                .parameters()
                .iter()
                .map(|p| crate::effect::amplitude_name(effect, p)),
        );
    }
    names.push(crate::infer::NOISE.into());
    let mut all = Vec::new();
    for &correlation_mm in &arguments.correlation_mm {
        let plan = Plan {
            replicates,
            correlation_mm,
            reduced: arguments.reduced,
            seed: global.seed,
            grid: arguments.grid,
            share: arguments.share()?,
        };
        let record = out.join(format!("sbc-{correlation_mm}mm.jsonl"));
        let found = calibration::calibrate(&model, &twin, &plan, &record, console)?;
        if plan.share.is_some() {
            say_share(&plan, found.len())?;
            continue;
        }
        let summary = calibration::summarise(&plan, &names, &found);
        print(&calibration_text(&summary))?;
        all.push(calibration_numbers(&summary));
    }
    finish(&out, "calibration", all)
}

/// Write the tables, if there are any: a share has none.
fn finish(out: &Path, key: &str, all: Vec<Value>) -> Result<()> {
    if all.is_empty() {
        return Ok(());
    }
    let value = json!({ "schema": crate::report::validation::SCHEMA, key: all });
    let path = out.join("validation.json");
    files::write_json(&path, &value)?;
    print(&format!("written to {}\n", path.display()))
}

fn say_share(plan: &Plan, done: usize) -> Result<()> {
    print(&format!(
        "{done} of {} replicates done, {} mm; the same command without --task makes the table\n",
        plan.replicates, plan.correlation_mm
    ))
}
