//! The command line: arguments, validated into a plan before any work, and one file a verb.

mod build;
mod calibrate;
mod campaign;
mod closing;
mod console;
mod design;
mod diagnose;
mod doe;
mod effects;
mod examples;
mod exports;
mod field_run;
mod folder;
mod force_rows;
mod forces;
mod fringes;
mod guide;
mod held;
mod identify;
mod init;
mod machine_file;
mod meshes;
mod output;
mod points;
mod population;
mod proposal;
mod proposed;
mod proposed_units;
mod report;
mod running;
mod sample;
mod samplers;
mod serve;
mod simulate;
mod study;
mod table_options;
mod validate;

use std::path::Path;

use clap::{Args, Parser, Subcommand};

use crate::error::{Error, Result};
use crate::signals::survive_file_limit;
use console::Console;
pub use console::line;
use output::{print, results};

/// Identify elastic constants, with their joint uncertainty, from a measured displacement field.
#[derive(Debug, Parser)]
#[command(
    version,
    propagate_version = true,
    arg_required_else_help = true,
    disable_help_subcommand = true,
    subcommand_help_heading = "Commands, the first three to start with"
)]
pub struct Cli {
    #[command(subcommand)]
    verb: Command,
    #[command(flatten)]
    global: Global,
}

/// Options of every verb.
#[derive(Debug, Args)]
#[command(next_help_heading = "Options of every command")]
struct Global {
    /// Seed of the random numbers; the same seed gives the same bits
    #[arg(long, global = true, default_value_t = 1)]
    seed: u64,
    /// Number of threads, 1 to 1024 (default: one per core); the results do not depend on it
    #[arg(long, global = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print results only: no progress, no remarks
    #[arg(long, global = true)]
    quiet: bool,
    /// Print everything: all tables of a run, and a line for each stage of the work
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Print results as one JSON value in place of text
    #[arg(long, global = true, conflicts_with = "verbose")]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a model file for your own specimen, or an example with its data
    Init(init::InitArguments),
    /// Identify the constants, look for causes of the residual, and report
    Loop(closing::LoopArguments),
    /// Write the report of a run again, or compare runs
    Report(report::ReportArguments),
    /// Suggest the next experiment
    Design(design::DesignArguments),
    /// List the effects, with their units, signs and tests
    Effects(effects::EffectsArguments),
    /// Simulate a measurement, with effects and noise
    Simulate(simulate::SimulateArguments),
    /// Compute a displacement field from pictures of fringes
    Fringes(fringes::FringesArguments),
    /// Identify the constants of a model from its measurement
    Identify(identify::IdentifyArguments),
    /// Weigh the effects that could explain a finished run's residual, without sampling again
    Trace(closing::TraceArguments),
    /// Check a posterior against grid, Monte Carlo, other priors and finite elements, or calibrate it
    Validate(validate::ValidateArguments),
    /// Run many specimens, here or on a cluster, and collect what they found
    Campaign(Box<campaign::CampaignArguments>),
    /// Check whether chains have converged
    Diagnose(diagnose::DiagnoseArguments),
    /// Write a run's chains in another program's format
    Export(diagnose::ExportArguments),
    /// Sample the log density that another program computes and serves over HTTP (UM-Bridge)
    Sample(sample::SampleArguments),
    /// Serve a model's log posterior and its predictions over HTTP on this machine (UM-Bridge), for other programs to sample
    Serve(serve::ServeArguments),
    /// Build the reduced model and print its error tables
    Build(build::BuildArguments),
    /// Write a table of constants for another finite-element program to solve, one row a solution
    DesignOfExperiments(doe::DoeArguments),
    /// Print the help of a command, or a section of the manuals
    Help(guide::HelpArguments),
}

/// Where runs are kept.
const RUNS: &str = "runs";

/// The default model, whose sample measurement lies beside it.
const DEFAULT_MODEL: &str = "models/openhole.json";

impl Command {
    /// The model that a verb begins with.
    fn model(&self) -> Option<&Path> {
        let model = match self {
            Self::Loop(arguments) => arguments.running.model(),
            Self::Identify(arguments) => arguments.running.model(),
            Self::Build(arguments) => &arguments.model,
            Self::Validate(arguments) => &arguments.target,
            Self::Design(arguments) => &arguments.model,
            Self::DesignOfExperiments(arguments) => &arguments.model,
            Self::Simulate(arguments) => &arguments.model,
            _ => return None,
        };
        Some(model)
    }
}
pub fn run(cli: Cli) -> Result<()> {
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| Error::program("--threads", "a thread pool").found(e))?;
    }
    survive_file_limit()?;
    output::prepare(&cli.global, &cli.verb)?;
    examples::supply_default(&cli.verb, &cli.global)?;
    let console = Console::new(cli.global.quiet, cli.global.verbose);
    match cli.verb {
        Command::Loop(arguments) => closing::close(&arguments, &cli.global, &console),
        Command::Trace(arguments) => closing::trace(&arguments, &console),
        Command::Identify(arguments) => identify::run(&arguments, &cli.global, &console),
        Command::Build(arguments) => build::run(&arguments, &console),
        Command::Sample(arguments) => sample::run(&arguments, &cli.global, &console),
        Command::Serve(arguments) => serve::run(&arguments, &console),
        Command::Diagnose(arguments) => diagnose::run(&arguments, &cli.global),
        Command::Export(arguments) => diagnose::export(&arguments, &cli.global),
        Command::Report(arguments) => report::run(&arguments),
        Command::Validate(arguments) => validate::run(&arguments, &cli.global, &console),
        Command::Campaign(arguments) => campaign::run(&arguments, &cli.global, &console),
        Command::Design(arguments) => design::run(&arguments, &console),
        Command::DesignOfExperiments(arguments) => doe::run(&arguments),
        Command::Fringes(arguments) => fringes::run(&arguments, &console),
        Command::Simulate(arguments) => simulate::run(&arguments, &cli.global),
        Command::Effects(arguments) => effects::run(&arguments),
        Command::Init(arguments) => init::run(&arguments),
        Command::Help(arguments) => guide::run(&arguments),
    }
}
