//! The command line: arguments, validated into a plan before any work, and one file a verb.

mod bench;
mod build;
mod calibrate;
mod campaign;
mod closing;
mod console;
mod design;
mod diagnose;
mod doe;
mod effects;
mod exports;
mod folder;
mod fringes;
mod identify;
mod init;
#[cfg(feature = "manual")]
mod manual;
mod mappings;
mod meshes;
mod points;
mod population;
mod report;
mod running;
mod simulate;
mod study;
mod validate;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::error::{Error, Result};
use console::Console;
pub use console::line;

/// Inference of ply elastic constants, with their joint uncertainty, from a measured displacement field.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    verb: Command,
    #[command(flatten)]
    global: Global,
}

/// Options of every verb.
#[derive(Debug, Clone, Args)]
struct Global {
    /// Seed of every random number; the same seed gives the same bits
    #[arg(long, global = true, default_value_t = 1)]
    seed: u64,
    /// Threads (default: one a core); the results do not depend on it
    #[arg(long, global = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// No progress, only results
    #[arg(long, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Identify, find what is left, trace it to an effect, add the effect, identify again, and report
    Loop(closing::LoopArguments),
    /// Identify the constants of a model from its measurement
    Identify(identify::IdentifyArguments),
    /// Trace what a finished run left unexplained to effects, without sampling again
    Trace(closing::TraceArguments),
    /// Build the reduced model and print its error tables
    Build(build::BuildArguments),
    /// Measure the speed of log posterior and samplers, of the default model or on a tabulated posterior
    Bench(bench::BenchArguments),
    /// Print what chains are worth: R-hat, effective draws, standard errors, and a verdict
    Diagnose(diagnose::DiagnoseArguments),
    /// Write a run's chains in another program's format
    Export(diagnose::ExportArguments),
    /// Make the report of a run again, or compare runs
    Report(report::ReportArguments),
    /// Hold a posterior against other ways to it: grid, Monte Carlo, other priors, finite elements, calibration
    Validate(validate::ValidateArguments),
    /// Run many: models, data and seeds, on this machine or on a cluster, and collect what they found
    Campaign(Box<campaign::CampaignArguments>),
    /// Say what to measure next: what coupons and plates would add, and which undeclared effects they would expose
    Design(design::DesignArguments),
    /// Write the constants for which another finite-element program is to solve a model's specimen, a table of one row a solution
    DesignOfExperiments(doe::DoeArguments),
    /// Measure a field from phase-shifted fringe images, with the sd of every point
    Fringes(fringes::FringesArguments),
    /// Simulate a measurement, in the article's format, with effects and noise
    Simulate(simulate::SimulateArguments),
    /// Print the dictionary of effects: what each is, its unit and plausible size, and what would confirm it
    Effects(effects::EffectsArguments),
    /// Write a model file to start from, for your own specimen
    Init(init::InitArguments),
    /// Print completions for a shell
    #[cfg(feature = "manual")]
    Completions(manual::CompletionsArguments),
    /// Print the manual page, or write those of all verbs
    #[cfg(feature = "manual")]
    Man(manual::ManArguments),
}

/// Where runs and cached reduced models are kept.
const RUNS: &str = "runs";

/// The default model, whose sample measurement lies beside it.
const DEFAULT_MODEL: &str = "models/openhole.json";

fn cache() -> PathBuf {
    PathBuf::from(RUNS).join(".cache")
}

/// Print results to standard output. A reader that has seen enough (`| head`) is no error.
fn print(text: &str) -> Result<()> {
    use std::io::{ErrorKind, Write};
    let mut out = anstream::stdout();
    match out
        .write_all(console::styled(text).as_bytes())
        .and_then(|()| out.flush())
    {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Error::input("standard output", "a place that can be written").found(e))
        }
        _ => Ok(()),
    }
}

pub fn run(cli: Cli) -> Result<()> {
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| Error::program("--threads", "a thread pool").found(e))?;
    }
    let console = Console::new(cli.global.quiet);
    match cli.verb {
        Command::Loop(arguments) => closing::close(&arguments, &cli.global, &console),
        Command::Trace(arguments) => closing::trace(&arguments, &console),
        Command::Identify(arguments) => identify::run(&arguments, &cli.global, &console),
        Command::Build(arguments) => build::run(&arguments, &console),
        Command::Bench(arguments) => bench::run(&arguments, &cli.global, &console),
        Command::Diagnose(arguments) => diagnose::run(&arguments),
        Command::Export(arguments) => diagnose::export(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Validate(arguments) => validate::run(&arguments, &cli.global, &console),
        Command::Campaign(arguments) => campaign::run(&arguments, &cli.global, &console),
        Command::Design(arguments) => design::run(&arguments, &console),
        Command::DesignOfExperiments(arguments) => doe::run(&arguments),
        Command::Fringes(arguments) => fringes::run(&arguments, &console),
        Command::Simulate(arguments) => simulate::run(&arguments, &cli.global),
        Command::Effects(arguments) => effects::run(&arguments),
        Command::Init(arguments) => init::run(&arguments),
        #[cfg(feature = "manual")]
        Command::Completions(arguments) => manual::completions(&arguments),
        #[cfg(feature = "manual")]
        Command::Man(arguments) => manual::man(&arguments),
    }
}
