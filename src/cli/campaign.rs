//! `plychain campaign`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::console::Console;
use super::{Global, RUNS, population, print, results};
use crate::campaign::collect::{Collected, MOST_Z, priors_section, write};
use crate::campaign::manifest::{self, CampaignManifest, ManifestEntry};
use crate::campaign::{self, Asked, Campaign, CampaignPlaces, Cluster, Resources, RunState};
use crate::error::{Error, Result};
use crate::files::absolute;
use crate::section::terminal;

/// Arguments of `campaign`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  plychain campaign coupons.json                         as many runs at a time as there are cores
  plychain campaign coupons.json --resume                what is missing
  plychain campaign coupons.json --engine slurm --time 4:00:00 --runs-a-task 10 --dry-run
  plychain campaign coupons.json --task 3 --of 8         the third of eight shares, under any scheduler
  plychain campaign status runs/coupons                  how each run stands, and what to do next
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
    /// Write one table of all runs: collected.csv, collected.html
    Collect(CollectArguments),
    /// Print the state of each run, and what to do next
    Status(CollectArguments),
    /// Compute mean, scatter, A- and B-basis values of the material over all specimens
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
    /// What stands after a word that is no verb
    #[arg(hide = true)]
    more: Vec<String>,
    /// The campaign's folder (default: runs/NAME)
    #[arg(long)]
    out: Option<PathBuf>,
    /// Continue the campaign in its folder: run what is missing
    #[arg(long)]
    resume: bool,
    /// With --resume, run failed runs again
    #[arg(long)]
    retry: bool,
    /// With --resume, run those again whose inputs changed; the old results go to replaced/
    #[arg(long, requires = "resume")]
    rerun_changed: bool,
    /// Engine: `local` or `slurm`
    #[arg(long, default_value = "local")]
    engine: String,
    /// Number of runs at a time, 1 to 1024 (default: cores / --threads; on a cluster 1 per task). A run has one thread, or --threads
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Maximum memory of a run, GB: its address space here, the memory to request on a cluster
    #[arg(long, value_name = "GB")]
    memory_gb: Option<f64>,
    /// Run only share K of N, from 1
    #[arg(long, value_name = "K", requires = "of", value_parser = clap::value_parser!(u32).range(1..))]
    task: Option<u32>,
    /// Number of shares, N
    #[arg(long, value_name = "N", requires = "task", value_parser = clap::value_parser!(u32).range(1..))]
    of: Option<u32>,
    /// Print the runs, or the script for the scheduler, and start nothing
    #[arg(long)]
    dry_run: bool,
    /// Number of runs in a task of the array (default: at most 500 tasks)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    runs_a_task: Option<u32>,
    /// Time of a task, as sbatch takes it. One minute before the end its runs stop and can be resumed
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Another option of sbatch, for example --sbatch=--partition=long; may be repeated
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// With --engine slurm, wait until the tasks end
    #[arg(long)]
    wait: bool,
}

/// Most tasks of an array where nothing is said; Slurm's own limit is 1001 unless it is set.
const MOST_TASKS: usize = 500;

pub fn run(arguments: &CampaignArguments, global: &Global, console: &Console) -> Result<()> {
    match &arguments.what {
        Some(What::Collect(collect)) => collected(collect),
        Some(What::Status(folder)) => standing(&folder.folder),
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
    let is_word = file.extension().is_none() && file.components().count() == 1 && !file.exists();
    if is_word || !arguments.more.is_empty() {
        let found = match is_word {
            true => file.display().to_string(),
            false => arguments.more.join(" "),
        };
        return Err(Error::input(
            "campaign",
            "one campaign file, or status, collect or population",
        )
        .found(found)
        .hint("plychain campaign --help shows examples"));
    }
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
        dry_run: arguments.dry_run,
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
    results(&manifest)?;
    print(&format!(
        "{}written to {folder}; plychain campaign collect {folder} makes the table\n",
        manifest.text()
    ))?;
    let own: Vec<RunState> = campaign
        .own()
        .iter()
        .map(|run| campaign.places.state(run).state)
        .collect();
    let count_in = |state: RunState| own.iter().filter(|s| **s == state).count();
    let failed = count_in(RunState::Failed);
    if failed > 0 {
        return Err(Error::input(folder, "runs that come to their end")
            .found(format!("{failed} of {} that failed", own.len()))
            .hint("log/ has what they printed; --resume --retry runs them again"));
    }
    let left = count_in(RunState::ToBeResumed) + count_in(RunState::Waiting);
    match left > 0 && !handed_on {
        true => Err(Error::stopped(folder, "runs that come to their end")
            .found(format!("{left} of {} to be resumed", own.len()))
            .hint("the same command with --resume goes on")),
        false => Ok(()),
    }
}

/// How the runs of a campaign stand, and what to do.
fn standing(folder: &Path) -> Result<()> {
    let places = CampaignPlaces(absolute(folder)?);
    let manifest = CampaignManifest::in_folder(&places)?;
    results(&manifest)?;
    let mut text = manifest.text().lines().take(1).collect::<String>();
    text += &format!("\n{}", manifest.lines());
    let queue = campaign::in_queue(&places, &manifest.name);
    text += &match &queue {
        Ok(None) => String::new(),
        Ok(Some(tasks)) => format!("{tasks} tasks wait or run in Slurm\n"),
        Err(e) => format!("Slurm's queue is not known: {e}\n"),
    };
    let count = |state| manifest.count(state);
    let left = count(RunState::Waiting) + count(RunState::ToBeResumed);
    if count(RunState::Failed) > 0 {
        text += "next: read log/NAME.txt of those that failed; --resume --retry runs them again\n";
    }
    text += &match (left, count(RunState::Running)) {
        (0, 0) if count(RunState::Failed) == 0 => format!(
            "next: plychain campaign collect {} makes the table\n",
            places.0.display()
        ),
        (0, _) => String::new(),
        (_, _) if matches!(queue, Ok(Some(1..))) => "next: wait for the tasks in Slurm\n".into(),
        (_, 0) => {
            "next: the command of the campaign with --resume goes on with what is left\n".into()
        }
        (_, _) => {
            "next: wait for the runs that are running; they are followed by the others\n".into()
        }
    };
    print(&text)
}

/// The tables of calibrations whose shares are all done.
fn calibrations(collected: &Collected, places: &CampaignPlaces) -> Result<()> {
    let program = std::env::current_exe()
        .map_err(|e| Error::program("campaign", "the path of the program").found(e))?;
    let mut seen = std::collections::BTreeSet::new();
    let runs = || collected.rows.iter().map(|r| &r.entry);
    for entry in runs() {
        let same_folder = |e: &&ManifestEntry| e.run.folder() == entry.run.folder();
        let all_done = runs()
            .filter(same_folder)
            .all(|e| e.status.state == RunState::Done);
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
    let places = CampaignPlaces(arguments.folder.clone());
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
    results(&collected.numbers())?;
    let [csv, html] = write(&collected, &arguments.folder)?;
    text += &terminal(&[priors_section(&collected)]);
    for row in collected.rows.iter().filter(|r| !r.warnings.is_empty()) {
        let (name, count) = (&row.entry.run.name, row.warnings.len());
        text += &format!("  {name} warns: {}", row.warnings[0]);
        text += &match count {
            1 => "\n".to_string(),
            _ => format!(" ({} more in collected.csv)\n", count - 1),
        };
    }
    text += &format!("written to {} and {}\n", csv.display(), html.display());
    print(&text)
}
