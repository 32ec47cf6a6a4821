//! `plychain validate`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::Value;

use super::calibrate::{self, CalibrationArguments};
use super::console::Console;
use super::field_run::write_identified;
use super::folder::{Folder, check_run, say_round};
use super::running::{identity, named_range};
use super::samplers::named;
use super::{DEFAULT_MODEL, Global, print, results};
use crate::chain::{Draws, read_zarr, write_zarr};
use crate::diagnose::{Row, Rule, diagnose};
use crate::error::{Error, Result};
use crate::identify::{self, InverseProblem, Options};
use crate::infer::Model;
use crate::posterior::{Importance, PosteriorDensity};
use crate::report::validation::Validation;
use crate::sample::{Keeping, LogDensity, Schedule};
use crate::section::terminal;
use crate::validate::grid::{self, PosteriorGrid};
use crate::validate::{priors, thickness};

/// Arguments of `validate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain validate runs/openhole
  plychain validate models/openhole.json --calibrate 20
  plychain validate models/openhole.json --calibrate 20 --loop --correlation-mm 0
  plychain validate models/openhole.json --calibrate 100 --loop --effects 3 --correlation-mm 0")]
pub struct ValidateArguments {
    /// Run folder, or a model file to be identified first
    #[arg(default_value = DEFAULT_MODEL, value_name = "RUN|MODEL")]
    pub(super) target: PathBuf,
    /// Measured data in place of the model's
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder for the checks of a model, which must not exist (default: the first free of runs/NAME-validate, ...). The checks of a run go to
    /// its own folder
    #[arg(long)]
    out: Option<PathBuf>,
    /// Number of grid nodes along each parameter
    #[arg(long, default_value_t = grid::NODES)]
    nodes: usize,
    /// Bounds of the grid for a parameter, NAME=LOW:HIGH (default: mean +- 5 sd of the chain)
    #[arg(long, value_name = "NAME=LOW:HIGH")]
    bounds: Vec<String>,
    /// Number of random nodes at which Monte Carlo propagates the thickness
    #[arg(long, default_value_t = 200)]
    monte_carlo: usize,
    #[command(flatten)]
    calibration: CalibrationArguments,
}

pub fn run(arguments: &ValidateArguments, global: &Global, console: &Console) -> Result<()> {
    if arguments.target.is_dir() {
        return run_folder(arguments, global, console);
    }
    let model = Model::load_with(&arguments.target, arguments.data.as_ref())?;
    if let Some(plans) = arguments.calibration.plans(global.seed)? {
        let default = || calibrate::folder(&plans, &model);
        let out = arguments.out.clone().unwrap_or_else(default);
        return calibrate::run(&plans, &out, &model, console);
    }
    let mut folder = Folder::create(
        arguments.out.as_deref(),
        &format!("{}-validate", model.file.name),
    )?;
    let sampler = named("ensemble")?;
    let schedule = Schedule {
        seed: global.seed,
        ..Schedule::default()
    };
    let identity = identity(&model, &*sampler, &schedule)?;
    folder.begin(&identity)?;
    let options = Options {
        schedule,
        keeping: Some(Keeping::within(folder.path(), identity, false)),
        ..Options::new(&*sampler)
    };
    let found = identify::identify(&model, &options, console)?;
    let page = write_identified(&model, std::slice::from_ref(&found), &folder, global.seed)?;
    page.write(folder.path())?;
    folder.write_json("run.json", &page.manifest)?;
    let run = FinishedRun {
        folder: &folder,
        inverse: &found.inverse,
        draws: &found.draws,
        importance: &found.importance,
    };
    let numbers = validate(arguments, &run, global.seed, console)?;
    finish(&numbers, &folder)?;
    folder.keep();
    Ok(())
}

fn run_folder(arguments: &ValidateArguments, global: &Global, console: &Console) -> Result<()> {
    let path = &arguments.target;
    let refused = |what: &str| {
        Err(Error::input(what, "a model file, not a run folder").found(path.display()))
    };
    if arguments.calibration.plans(global.seed)?.is_some() {
        return refused("--calibrate");
    }
    if arguments.out.is_some() || arguments.data.is_some() {
        return Err(Error::input(
            "--out and --data",
            "a model file: a run's validation is of its own data, and goes into its folder",
        )
        .found(path.display()));
    }
    let folder = Folder::of_run(path)?;
    say_round(path);
    let model = Model::load_with(&path.join("model.json"), None)?;
    check_run(path, &model)?;
    let draws = read_zarr(&path.join("chain.zarr"), None)?;
    let prepared = identify::prepare(&model, console)?;
    let inverse = identify::inverse_problem(&model, prepared, console)?;
    if draws.names() != inverse.posed.density.names() {
        return Err(Error::input(
            path.join("chain.zarr").display(),
            format!(
                "a chain of {}, as the run's model has",
                inverse.posed.density.names().join(", ")
            ),
        )
        .found(draws.names().join(", "))
        .hint("this chain is of another model"));
    }
    if draws.is_empty() {
        return Err(
            Error::input(path.join("chain.zarr").display(), "a chain with draws").found("none"),
        );
    }
    let importance = identify::checked(&model, (&inverse, &draws), global.seed, console)?;
    let run = FinishedRun {
        folder: &folder,
        inverse: &inverse,
        draws: &draws,
        importance: &importance,
    };
    let numbers = validate(arguments, &run, global.seed, console)?;
    finish(&numbers, &folder)
}

/// An identification that is held against other ways to its posterior.
struct FinishedRun<'a> {
    folder: &'a Folder,
    inverse: &'a InverseProblem,
    draws: &'a Draws,
    /// How the draws fare under the finite elements.
    importance: &'a Importance,
}

/// Compare the chain with everything else that is known of its posterior, print it, and return it as `validation.json` has it.
fn validate(
    arguments: &ValidateArguments,
    run: &FinishedRun<'_>,
    seed: u64,
    console: &Console,
) -> Result<Value> {
    let (inverse, draws) = (run.inverse, run.draws);
    let posterior = &inverse.posed.density;
    let chain = diagnose(draws, &Rule::default()).rows;
    let mode = identify::start(posterior)?;
    let bounds = bounds(arguments, posterior, &chain)?;
    let small = is_small(arguments.nodes, posterior.constants());
    let began = Instant::now();
    let evaluated = small
        .then(|| PosteriorGrid::new(posterior, &mode, &bounds, arguments.nodes))
        .transpose()?;
    let seconds = began.elapsed().as_secs_f64();
    if let Some(grid) = &evaluated {
        write_grid(grid, &run.folder.path().join("grid"))?;
    }
    let compared = thickness::compare(
        &inverse.posed,
        &bounds,
        mode.mode.get(posterior.constants()).copied(),
        [arguments.monte_carlo, thickness::SAMPLES],
        seed,
        console,
    );
    let priors = match small {
        true => priors::compare(posterior, arguments.nodes)?,
        false => Vec::new(),
    };
    let validation = Validation {
        chain: &chain,
        grid: evaluated.as_ref().map(|g| (g, seconds)),
        thickness: compared.as_ref(),
        priors: &priors,
        importance: run.importance,
    };
    let section = validation.section(&arguments.target.display().to_string());
    print(&terminal(&[section]))?;
    Ok(validation.numbers())
}

/// Draws of the grid in a folder with the chain files of a run.
fn write_grid(grid: &PosteriorGrid, folder: &Path) -> Result<()> {
    let failed = |e| Error::input(folder.display(), "a folder that can be written").found(e);
    if folder.exists() {
        // of an earlier validation
        std::fs::remove_dir_all(folder).map_err(failed)?;
    }
    std::fs::create_dir_all(folder).map_err(failed)?;
    let draws = grid.draws(GRID_CHAINS, GRID_DRAWS)?;
    write_zarr(&draws, &folder.join("chain.zarr"))
}

/// Chains, and draws a chain, as which a grid is written.
const GRID_CHAINS: usize = 4;
const GRID_DRAWS: usize = 2500;

/// The grid's bounds: about the chain, or as declared.
fn bounds(
    arguments: &ValidateArguments,
    posterior: &PosteriorDensity,
    chain: &[Row],
) -> Result<Vec<[f64; 2]>> {
    let rows = chain[..posterior.constants()].iter();
    let (mean, sd): (Vec<f64>, Vec<f64>) = rows.map(|r| (r.mean, r.sd)).unzip();
    let mut bounds = grid::automatic(posterior, &mean, &sd);
    declared_bounds(&arguments.bounds, posterior, &mut bounds)?;
    grid::check_bounds(posterior, &bounds)?;
    Ok(bounds)
}

/// A grid over more than the four constants would have millions of nodes.
fn is_small(nodes: usize, d: usize) -> bool {
    d <= 4 || nodes.checked_pow(d as u32).is_some_and(|n| n <= 2_000_000)
}

/// Write `validation.json`.
fn finish(numbers: &Value, folder: &Folder) -> Result<()> {
    folder.write_json("validation.json", numbers)?;
    results(numbers)?;
    print(&format!(
        "written to {}\n",
        folder.path().join("validation.json").display()
    ))
}

/// Put `NAME=LOW:HIGH` into the bounds.
fn declared_bounds(
    texts: &[String],
    posterior: &PosteriorDensity,
    bounds: &mut [[f64; 2]],
) -> Result<()> {
    let names = posterior.constant_names();
    for text in texts {
        let wrong = || {
            Error::input(
                format!("--bounds {text}"),
                format!("NAME=LOW:HIGH with one of {}", names.join(", ")),
            )
        };
        let (name, range) = named_range(text).ok_or_else(wrong)?;
        let k = names.iter().position(|n| n == name);
        bounds[k.ok_or_else(|| wrong().found(name))?] = range;
    }
    Ok(())
}
