//! `plychain identify`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::folder::Folder;
use super::{DEFAULT_MODEL, Global, cache, print};
use crate::chain::write_csv;
use crate::diagnose::Rule;
use crate::error::{Error, Result};
use crate::infer::Model;
use crate::report::{numbers, terminal};
use crate::sample::{SAMPLERS, Sampler, Schedule};
use crate::trace::{self, Options};

/// Arguments of `identify`.
#[derive(Debug, Args)]
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
    let folder = Folder::create(arguments.out.as_deref(), &model.file.name)?;
    let options = Options {
        sampler: &*sampler,
        schedule: Schedule {
            seed: global.seed,
            ..Schedule::default()
        },
        rule: Rule::default(),
        cache: cache(),
        refinements: arguments.refine.map_or(0, usize::from),
    };
    let round = trace::identify(&model, &options, console)?;
    print(&terminal::identification(&model, &round))?;
    write_csv(&round.draws, &folder.path().join("chain.csv"))?;
    let mut resolved = model.file.clone();
    resolved.measurement = resolved.measurement.below(model.base_dir())?;
    let resolved = serde_json::to_value(&resolved)
        .map_err(|e| Error::program("model.json", "a model that JSON can hold").found(e))?;
    folder.write_json("model.json", &resolved)?;
    let rounds = [round];
    folder.write_json(
        "report.json",
        &numbers::report(&model, &rounds, global.seed),
    )?;
    folder.write_manifest(
        &model,
        &rounds[0].prepared.observation.field.files,
        global.seed,
    )?;
    print(&format!("written to {}\n", folder.path().display()))?;
    folder.keep();
    let [round] = rounds;
    if arguments.strict && !round.verdict.converged {
        return Err(Error::input("--strict", "converged chains")
            .found(round.verdict.line())
            .hint("run longer"));
    }
    Ok(())
}

fn sampler(name: &str) -> Result<Box<dyn Sampler>> {
    SAMPLERS
        .iter()
        .find(|entry| entry.name == name)
        .map(|entry| (entry.build)())
        .ok_or_else(|| {
            let known: Vec<_> = SAMPLERS.iter().map(|entry| entry.name).collect();
            Error::input("--sampler", format!("one of {}", known.join(", "))).found(name)
        })
}
