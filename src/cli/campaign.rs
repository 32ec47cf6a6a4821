//! `plychain campaign`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::console::Console;
use super::{Global, RUNS, population, print};
use crate::campaign::collect::{Collected, MOST_Z, write};
use crate::campaign::manifest::{self, CampaignManifest, Entry};
use crate::campaign::{self, Asked, Campaign, Cluster, Places, Resources, State};
use crate::error::{Error, Result};

/// Arguments of `campaign`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  plychain campaign coupons.json                         as many runs at a time as there are cores
  plychain campaign coupons.json --resume                what is missing
  plychain campaign coupons.json --engine slurm --time 4:00:00 --runs-a-task 10 --dry-run
  plychain campaign coupons.json --task 3 --of 8         the third of eight shares, under any scheduler
  plychain campaign collect runs/coupons                 one table of all runs
  plychain campaign population runs/coupons              the material: mean, scatter, A- and B-basis values

Exit status: 0 all runs done (or handed to the scheduler), 1 the input's fault or a run that failed, 2 the program's fault,
75 told to stop by SIGTERM or tasks lost: --resume goes on."
)]
pub struct CampaignArguments {
    #[command(subcommand)]
    what: Option<What>,
    #[command(flatten)]
    running: RunArguments,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Write one table of all runs: collected.csv, collected.zarr, collected.html
    Collect(CollectArguments),
    /// Mean and scatter of the material's constants over the specimens of a campaign, with A- and B-basis values
    Population(population::PopulationArguments),
}

#[derive(Debug, Args)]
struct CollectArguments {
    /// Folder of a campaign
    folder: PathBuf,
}

#[derive(Debug, Args)]
struct RunArguments {
    /// Campaign file
    #[arg(value_name = "CAMPAIGN")]
    campaign: Option<PathBuf>,
    /// The campaign's folder (default: runs/NAME)
    #[arg(long)]
    out: Option<PathBuf>,
    /// Go on with the campaign in its folder: run what is missing
    #[arg(long)]
    resume: bool,
    /// With --resume, run those again that failed
    #[arg(long)]
    retry: bool,
    /// With --resume, run those again whose inputs changed, and keep what there was of them in replaced/
    #[arg(long, requires = "resume")]
    rerun_changed: bool,
    /// Engine: local or slurm
    #[arg(long, default_value = "local")]
    engine: String,
    /// Runs at a time (default: cores over --threads; 1 a task of a cluster). A run has one thread, or --threads
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Most memory of a run, GB: its address space here, what is asked of the scheduler on a cluster
    #[arg(long, value_name = "GB")]
    memory_gb: Option<f64>,
    /// Run share K of N only
    #[arg(long, value_name = "K", requires = "of", value_parser = clap::value_parser!(u32).range(1..))]
    task: Option<u32>,
    /// Number of shares
    #[arg(long, value_name = "N", requires = "task", value_parser = clap::value_parser!(u32).range(1..))]
    of: Option<u32>,
    /// Print what would be run, or the script that would be submitted
    #[arg(long)]
    dry_run: bool,
    /// Runs of a task of the array (default: so many that there are 500 tasks at most)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    runs_a_task: Option<u32>,
    /// Time of a task, in sbatch's words; a minute before, its runs are told to stop
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Further option of sbatch, as it stands: --sbatch=--partition=long
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// With --engine slurm, wait for the end of the tasks
    #[arg(long)]
    wait: bool,
}

/// Most tasks of an array where nothing is said; Slurm's own limit is 1001 unless it is set.
const MOST_TASKS: usize = 500;

pub fn run(arguments: &CampaignArguments, global: &Global, console: &Console) -> Result<()> {
    match &arguments.what {
        Some(What::Collect(collect)) => collected(collect),
        Some(What::Population(arguments)) => population::run(arguments, global, console),
        None => start(&arguments.running, global, console),
    }
}

fn start(arguments: &RunArguments, global: &Global, console: &Console) -> Result<()> {
    let engine = campaign::engine(&arguments.engine)?;
    let asked = asked(arguments, global)?;
    let mut campaign = campaign::settle(&asked)?;
    let cluster = &mut campaign.resources.cluster;
    if arguments.runs_a_task.is_none() {
        cluster.runs_a_task = campaign.plan.runs.len().div_ceil(MOST_TASKS);
    }
    if arguments.dry_run {
        return print(&engine.script(&campaign)?);
    }
    engine.run(&campaign, console)?;
    finish(&campaign, arguments.engine == "slurm")
}

fn asked(arguments: &RunArguments, global: &Global) -> Result<Asked> {
    let file = arguments.campaign.clone().ok_or_else(|| {
        Error::input("CAMPAIGN", "a campaign file").hint("plychain campaign --help shows examples")
    })?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => PathBuf::from(RUNS).join(campaign::name_of(&file)?),
    };
    let share = match (arguments.task, arguments.of) {
        (Some(k), Some(n)) if k > n => {
            return Err(Error::input("--task", format!("a number from 1 to {n}")).found(k));
        }
        (Some(k), Some(n)) => Some([k as usize, n as usize]),
        _ => None,
    };
    if let Some(gb) = arguments.memory_gb
        && !(gb > 0.0 && gb < 1e6)
    {
        return Err(Error::input("--memory-gb", "a number of GB above 0").found(gb));
    }
    let threads = usize::from(global.threads.unwrap_or(1));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let at_once = match arguments.jobs {
        Some(jobs) => usize::from(jobs),
        None if arguments.engine == "slurm" => 1,
        None => (cores / threads).max(1),
    };
    let program = std::env::current_exe()
        .map_err(|e| Error::program("campaign", "the path of the program").found(e))?;
    Ok(Asked {
        file,
        out,
        resume: arguments.resume,
        rerun_changed: arguments.rerun_changed,
        retry: arguments.retry,
        share,
        seed: global.seed,
        resources: Resources {
            program,
            threads,
            at_once,
            memory_gb: arguments.memory_gb,
            cluster: Cluster {
                runs_a_task: arguments.runs_a_task.unwrap_or(1) as usize,
                time: arguments.time.clone(),
                options: arguments.sbatch.clone(),
                wait: arguments.wait,
            },
        },
    })
}

/// Say how the campaign stands; runs that failed are an error, of a share its own.
fn finish(campaign: &Campaign, handed_on: bool) -> Result<()> {
    let manifest = manifest::write(campaign)?;
    let folder = campaign.places.0.display();
    print(&format!(
        "{}written to {folder}; plychain campaign collect {folder} makes the table\n",
        manifest.text()
    ))?;
    let own: Vec<State> = campaign
        .own()
        .iter()
        .map(|run| campaign.places.state(run).state)
        .collect();
    let count_in = |state: State| own.iter().filter(|s| **s == state).count();
    let failed = count_in(State::Failed);
    if failed > 0 {
        return Err(Error::input(folder, "runs that come to their end")
            .found(format!("{failed} of {} that failed", own.len()))
            .hint("log/ has what they printed; --resume --retry runs them again"));
    }
    let left = count_in(State::ToBeResumed) + count_in(State::Waiting);
    match left > 0 && !handed_on {
        true => Err(Error::stopped(folder, "runs that come to their end")
            .found(format!("{left} of {} to be resumed", own.len()))
            .hint("the same command with --resume goes on")),
        false => Ok(()),
    }
}

/// The tables of calibrations whose shares are all done.
fn calibrations(collected: &Collected, places: &Places) -> Result<()> {
    let program = std::env::current_exe()
        .map_err(|e| Error::program("campaign", "the path of the program").found(e))?;
    let mut seen = std::collections::BTreeSet::new();
    let runs = || collected.rows.iter().map(|r| &r.entry);
    for entry in runs() {
        let same_folder = |e: &&Entry| e.run.folder() == entry.run.folder();
        let all_done = runs()
            .filter(same_folder)
            .all(|e| e.status.state == State::Done);
        if !all_done || !seen.insert(entry.run.folder()) {
            continue;
        }
        let mut table = std::process::Command::new(&program);
        table.args(entry.run.whole(&places.run(&entry.run)));
        let end = table.arg("--quiet").status();
        let failed = || Error::program(entry.run.folder(), "a table of its records");
        if !end.map_err(|e| failed().found(e))?.success() {
            return Err(failed());
        }
    }
    Ok(())
}

fn collected(arguments: &CollectArguments) -> Result<()> {
    let places = Places(arguments.folder.clone());
    let collected = Collected::gather(&places)?;
    let mut text = CampaignManifest::in_folder(&places)?.text();
    for (row, name, z) in collected.outlying() {
        text += &format!(
            "  {} is unlike the others: {name} lies {z:.1} sds from their median (more than {MOST_Z})\n",
            row.entry.run.name
        );
    }
    if collected.rows.iter().any(|r| r.entry.run.share.is_some()) {
        print(&text)?;
        return calibrations(&collected, &places);
    }
    let [csv, zarr, html] = write(&collected, &arguments.folder)?;
    text += &format!(
        "written to {}, {} and {}\n",
        csv.display(),
        zarr.display(),
        html.display()
    );
    print(&text)
}
