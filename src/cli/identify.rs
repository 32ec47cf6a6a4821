//! `plychain identify`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::console::Console;
use super::folder::{Folder, hashes};
use super::{DEFAULT_MODEL, Global, cache, print};
use crate::chain::write_csv;
use crate::diagnose::Rule;
use crate::error::{Error, Result};
use crate::infer::Model;
use crate::progress::Watch;
use crate::reduce::cache::hex;
use crate::report::{Page, numbers, terminal};
use crate::sample::{Keeping, SAMPLERS, Sampler, Schedule};
use crate::trace::{self, Options, Round};

/// Arguments of `identify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain identify
  plychain identify specimen.json --data other.csv --refine --strict
  plychain identify specimen.json --out runs/long --resume    go on with an interrupted run")]
pub struct Arguments {
    /// Model file
    #[arg(default_value = DEFAULT_MODEL)]
    model: PathBuf,
    /// Measured data in place of the model's: a directory of matrices, or a CSV file
    #[arg(long)]
    data: Option<PathBuf>,
    /// Run folder, which must not exist (default: the first free of runs/NAME, runs/NAME-2, ...)
    #[arg(long)]
    out: Option<PathBuf>,
    /// Sampler: ensemble or adaptive
    #[arg(long, default_value = "ensemble")]
    sampler: String,
    /// Refine the reduced model about the posterior while the finite elements disagree by more than 1 % of a posterior
    /// sd or draws lie outside the DoE box, at most ROUNDS times
    #[arg(long, value_name = "ROUNDS", num_args = 0..=1, require_equals = true, default_missing_value = "3", value_parser = clap::value_parser!(u8).range(1..=20))]
    refine: Option<u8>,
    /// Exit with an error if the chains have not converged
    #[arg(long)]
    strict: bool,
    /// Go on with the run in --out where it was interrupted, to the same bits
    #[arg(long, requires = "out", conflicts_with = "refine")]
    resume: bool,
    /// Write the figures as PNG too
    #[arg(long)]
    png: bool,
    #[command(flatten)]
    limits: Limits,
}

/// When sampling ends.
#[derive(Debug, Clone, Args)]
pub struct Limits {
    /// Most draws, over all chains
    #[arg(long, value_name = "N")]
    max_draws: Option<usize>,
    /// Effective draws, bulk and tail, that every parameter must reach (default: 100 an ensemble)
    #[arg(long, value_name = "N")]
    min_ess: Option<f64>,
    /// Stop sampling after this many seconds
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
}

impl Limits {
    /// Put the limits into a schedule and a rule; when to stop in any case.
    pub fn apply(&self, schedule: &mut Schedule, rule: &mut Rule) -> Result<Option<Instant>> {
        if let Some(most) = self.max_draws {
            if most == 0 {
                return Err(Error::input("--max-draws", "a number above 0").found(most));
            }
            schedule.max_draws = most;
        }
        if let Some(ess) = self.min_ess {
            if !(ess > 0.0 && ess.is_finite()) {
                return Err(Error::input("--min-ess", "a number above 0").found(ess));
            }
            rule.ess = ess / schedule.ensembles as f64;
        }
        let Some(seconds) = self.time_limit else {
            return Ok(None);
        };
        std::time::Duration::try_from_secs_f64(seconds)
            .ok()
            .filter(|limit| !limit.is_zero())
            .and_then(|limit| Instant::now().checked_add(limit))
            .map(Some)
            .ok_or_else(|| {
                Error::input("--time-limit", "a number of seconds above 0").found(seconds)
            })
    }
}

/// Read a model, with its measurement elsewhere if `data` says so.
pub fn load(path: &std::path::Path, data: Option<&PathBuf>) -> Result<Model> {
    let mut model = Model::load(path)?;
    if let Some(data) = data {
        // Joined to the model's directory later, an absolute path stays as it is.
        let absolute = std::path::absolute(data)
            .map_err(|e| Error::input(format!("--data {}", data.display()), "a path").found(e))?;
        model.file.measurement = model.file.measurement.with_path(absolute);
    }
    Ok(model)
}

/// Run the verb.
pub fn run(arguments: &Arguments, global: &Global, console: &Console) -> Result<()> {
    let model = load(&arguments.model, arguments.data.as_ref())?;
    let sampler = sampler(&arguments.sampler)?;
    let mut schedule = Schedule {
        seed: global.seed,
        ..Schedule::default()
    };
    let mut rule = Rule::default();
    let deadline = arguments.limits.apply(&mut schedule, &mut rule)?;
    let folder = Folder::open(arguments.out.as_deref(), &model.file.name, arguments.resume)?;
    let identity = identity(&model, &*sampler, &schedule)?;
    folder.begin(&identity)?;
    let options = Options {
        sampler: &*sampler,
        schedule,
        rule,
        cache: cache(),
        refinements: arguments.refine.map_or(0, usize::from),
        keeping: Some(Keeping {
            store: folder.path().join("chain.zarr"),
            checkpoint: folder.path().join("checkpoint"),
            identity,
            resume: arguments.resume,
            observed: Vec::new(),
        }),
        discrepancy: [None, None],
        deadline,
    };
    let round = trace::identify(&model, &options, console)?;
    print(&terminal::identification(&model, &round))?;
    let rounds = [round];
    let page = write(&model, &rounds, &folder, global.seed)?;
    console.begin("report and figures", None);
    page.write(folder.path(), arguments.png)?;
    console.end();
    let [round] = rounds;
    let path = folder.path().display();
    print(&format!("written to {path}; open {path}/report.html\n"))?;
    folder.keep();
    if arguments.strict && !round.verdict.converged {
        return Err(Error::input("--strict", "converged chains")
            .found(round.verdict.line())
            .hint("run longer"));
    }
    Ok(())
}

/// What `truth.json` beside simulated data says; `None` for measured data.
///
/// # Errors
/// The input's fault if the file is there and is no JSON.
pub fn truth(files: &[PathBuf]) -> Result<Option<Value>> {
    let beside = files.first().and_then(|f| f.parent());
    let Some(path) = beside.map(|d| d.join("truth.json")).filter(|p| p.is_file()) else {
        return Ok(None);
    };
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Error::input(path.display(), "a readable file").found(e))?;
    let truth = serde_json::from_str(&text)
        .map_err(|e| Error::input(path.display(), "valid JSON").found(e))?;
    Ok(Some(truth))
}

/// The model with its measurement's absolute path, so that it can be read from a run's folder.
pub fn resolved(model: &Model) -> Result<Value> {
    let mut resolved = model.file.clone();
    resolved.measurement = resolved.measurement.below(model.base_dir())?;
    serde_json::to_value(&resolved)
        .map_err(|e| Error::program("model.json", "a model that JSON can hold").found(e))
}

/// Write what a run leaves behind beside its chain store, and return the page that shows it, which is still to be written.
pub fn write(model: &Model, rounds: &[Round], folder: &Folder, seed: u64) -> Result<Page> {
    if let Some(round) = rounds.last() {
        write_csv(&round.draws, &folder.path().join("chain.csv"))?;
    }
    folder.write_json("model.json", &resolved(model)?)?;
    let report = numbers::report(model, rounds, seed);
    folder.write_json("report.json", &report)?;
    let files = rounds
        .last()
        .map(|r| &r.prepared.observation.field.files[..])
        .unwrap_or_default();
    let manifest = folder.write_manifest(model, files, seed)?;
    let rounds: Vec<&Round> = rounds.iter().collect();
    Ok(Page::gather(&rounds, report, manifest, truth(files)?))
}

/// What a resumed run must share with the one that was interrupted.
pub fn identity(model: &Model, sampler: &dyn Sampler, schedule: &Schedule) -> Result<Value> {
    let text = serde_json::to_string(&model.file)
        .map_err(|e| Error::program("model", "a model that JSON can hold").found(e))?;
    Ok(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "model": model.file.name,
        "model_sha256": hex(&Sha256::digest(text)),
        "data_sha256": hashes(model.read_field()?.files.iter())?.values().collect::<Vec<_>>(),
        "seed": schedule.seed,
        "sampler": sampler.name(),
        "ensembles": schedule.ensembles,
    }))
}

/// The sampler of a name.
pub fn sampler(name: &str) -> Result<Box<dyn Sampler>> {
    SAMPLERS
        .iter()
        .find(|entry| entry.name == name)
        .map(|entry| (entry.build)())
        .ok_or_else(|| {
            let known: Vec<_> = SAMPLERS.iter().map(|entry| entry.name).collect();
            Error::input("--sampler", format!("one of {}", known.join(", "))).found(name)
        })
}
