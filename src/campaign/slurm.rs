//! Runs on a cluster: one job array of Slurm, a share of the runs a task. What is queued is asked of `squeue`, which knows it with and
//! without accounting; what became of a run is in the run's own files.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::process::Command;
use std::time::Duration;

use sha2::{Digest, Sha256};

use super::engine::{Campaign, Engine};
use super::manifest;
use super::process::quoted;
use super::status::{CampaignPlaces, RunState};
use crate::error::{Error, Result};
use crate::files;
use crate::files::hex;
use crate::progress::Progress;

pub struct Slurm;

/// Seconds before a task's time is over at which it is told to stop, for what runs flush then.
const NOTICE_S: u32 = 60;

/// Between two looks at the queue, and how often in a row it may give no answer: a controller that is restarted is waited for.
const PATIENCE: Duration = Duration::from_secs(2);
const SILENCES: usize = 300;

impl Engine for Slurm {
    fn name(&self) -> &'static str {
        "slurm"
    }

    fn script(&self, campaign: &Campaign) -> Result<String> {
        let missing = tasks(campaign).into_iter();
        let missing = missing.filter(|&k| is_missing(campaign, k)).collect();
        script(campaign, &missing)
    }

    fn run(&self, campaign: &Campaign, progress: &dyn Progress) -> Result<()> {
        if campaign.share.is_some() {
            return Err(
                Error::input("--task", "no share: an array gives its tasks theirs")
                    .found("the engine slurm")
                    .hint("a share is run with --engine local"),
            );
        }
        progress.begin(&submitted(campaign)?, None);
        progress.end();
        let wait = campaign.resources.cluster.wait;
        let hint = match wait && watch(campaign, progress)? {
            true => RELEASE,
            false => {
                "the same command with --resume submits them again; sacct says how tasks ended"
            }
        };
        let manifest = manifest::write(campaign)?;
        let left = manifest.count(RunState::ToBeResumed) + manifest.count(RunState::Waiting);
        if !wait || left == 0 {
            return Ok(());
        }
        Err(
            Error::stopped(campaign.places.0.display(), "runs that come to their end")
                .found(format!("{left} to be resumed"))
                .hint(hint),
        )
    }
}

/// Tasks of the array, counted from 1.
fn count(campaign: &Campaign) -> usize {
    let chunk = campaign.resources.cluster.runs_a_task;
    campaign.plan.runs.len().div_ceil(chunk)
}

fn tasks(campaign: &Campaign) -> BTreeSet<usize> {
    (1..=count(campaign)).collect()
}

/// Whether a task's share has runs to be brought to their end.
fn is_missing(campaign: &Campaign, k: usize) -> bool {
    let share = campaign.of_share([k, count(campaign)]);
    share.into_iter().any(|run| campaign.is_missing(run))
}

/// The name of the campaign's jobs, by which they are found in the queue again. Two campaigns of one name have different folders.
fn name(places: &CampaignPlaces, campaign: &str) -> String {
    let folder = places.0.display().to_string();
    let mark = hex(&Sha256::digest(folder));
    format!("plychain-{campaign}-{}", &mark[..8])
}

/// How many tasks of a campaign wait or run, if any were ever submitted from its folder, which is absolute.
///
/// # Errors
/// Of the input: a scheduler that does not answer.
pub fn in_queue(places: &CampaignPlaces, campaign: &str) -> Result<Option<usize>> {
    match places.0.join("slurm").is_dir() {
        true => queued(&name(places, campaign)).map(|queue| Some(queue.len())),
        false => Ok(None),
    }
}

/// The job script of some tasks.
fn script(campaign: &Campaign, tasks: &BTreeSet<usize>) -> Result<String> {
    let failed = |e| Error::input("the current directory", "one that exists").found(e);
    let here = std::env::current_dir().map_err(failed)?;
    let folder = &campaign.places.0;
    let resources = &campaign.resources;
    let list: Vec<String> = tasks.iter().map(usize::to_string).collect();
    let mut text = String::from("#!/bin/sh\n");
    let mut option = |name: &str, value: &str| {
        let _ = writeln!(text, "#SBATCH --{name}={}", quoted(value));
    };
    option("job-name", &name(&campaign.places, &campaign.plan.name));
    option("array", &list.join(","));
    option(
        "cpus-per-task",
        &(resources.threads * resources.at_once).to_string(),
    );
    if let Some(gb) = resources.memory_gb {
        let mib = (gb * 1e9 * resources.at_once as f64 / 1_048_576.0).ceil();
        option("mem", &format!("{mib}M"));
    }
    if let Some(time) = &resources.cluster.time {
        option("time", time);
    }
    option("signal", &format!("B:TERM@{NOTICE_S}"));
    option("chdir", &here.display().to_string());
    option(
        "output",
        &folder.join("slurm/%A_%a.txt").display().to_string(),
    );
    option("open-mode", "append");
    for own in &resources.cluster.options {
        let _ = writeln!(text, "#SBATCH {own}");
    }
    // the program takes the shell's place, so that the signal reaches it
    let words = [
        resources.program.display().to_string(),
        "campaign".into(),
        campaign.file.display().to_string(),
        "--out".into(),
        folder.display().to_string(),
    ];
    let words: Vec<String> = words.iter().map(|w| quoted(w)).collect();
    let _ = write!(
        text,
        "exec {} --task \"$SLURM_ARRAY_TASK_ID\" --of {} --jobs {} --threads {} --quiet",
        words.join(" "),
        count(campaign),
        resources.at_once,
        resources.threads
    );
    text += if campaign.retry { " --retry\n" } else { "\n" };
    Ok(text)
}

/// Submit the tasks that are missing and not queued; what is to be said of it. Nobody else submits from the look at the queue to the
/// scheduler's answer.
fn submitted(campaign: &Campaign) -> Result<String> {
    let _alone = campaign.places.submitting()?;
    let queued = queued(&name(&campaign.places, &campaign.plan.name))?;
    let missing: BTreeSet<usize> = tasks(campaign)
        .into_iter()
        .filter(|k| !queued.contains_key(k) && is_missing(campaign, *k))
        .collect();
    if missing.is_empty() {
        let held = match queued.values().any(|held| *held) {
            true => format!("; {RELEASE}"),
            false => String::new(),
        };
        return Ok(format!(
            "nothing to submit, {} tasks queued{held}",
            queued.len()
        ));
    }
    let job = submit(campaign, &missing)?;
    Ok(format!("job {job}: {} tasks submitted", missing.len()))
}

/// The number of the job that was submitted.
fn submit(campaign: &Campaign, tasks: &BTreeSet<usize>) -> Result<String> {
    let folder = campaign.places.0.join("slurm");
    files::make_folder(&folder)?;
    let path = folder.join("script.sh");
    files::replace(&path, script(campaign, tasks)?)?;
    let path = path.display().to_string();
    let said = answer("sbatch", &["--parsable", &path])?;
    job_number(&said).ok_or_else(|| {
        let found = match said.trim() {
            "" => "no answer",
            said => said,
        };
        Error::input("sbatch", "the number of a job")
            .found(found)
            .hint("nothing counts as submitted; look at squeue --me, then give the same command with --resume")
    })
}

/// The number of a job in an answer of `sbatch`, which clusters may precede with a banner: `N`, `N;CLUSTER` or `Submitted batch job N`.
fn job_number(answer: &str) -> Option<String> {
    let number = |line: &str| {
        let line = line.trim();
        let line = line.strip_prefix("Submitted batch job").unwrap_or(line);
        let first = line.split(';').next().unwrap_or_default().trim();
        let digits = !first.is_empty() && first.bytes().all(|b| b.is_ascii_digit());
        digits.then(|| first.to_string())
    };
    answer.lines().rev().find_map(number)
}

/// What to do about an error of Slurm, by its words.
const REMEDIES: [(&str, &str); 7] = [
    (
        "invalid job array specification",
        "the cluster takes fewer tasks in an array (MaxArraySize in scontrol show config): give more runs a task with --runs-a-task N",
    ),
    (
        "job submit limit",
        "the account may queue fewer tasks: give more runs a task with --runs-a-task N, or wait and --resume",
    ),
    (
        "partition",
        "name a partition: --sbatch=--partition=NAME (sinfo lists them)",
    ),
    ("account", "name an account: --sbatch=--account=NAME"),
    (
        "time limit",
        "give a time that the partition allows: --time HH:MM:SS",
    ),
    (
        "memory",
        "ask for less: --memory-gb GB, or fewer runs at a time with --jobs N",
    ),
    (
        "configuration is not available",
        "no node has so much: ask for fewer cores (--threads, --jobs) or less memory (--memory-gb)",
    ),
];

/// Parts of the reasons for which a task waits until somebody does something about it.
const HELD: [&str; 2] = ["held", "neversatisfied"];

/// What to do about tasks that are held back.
const RELEASE: &str = "tasks are held by Slurm: find them with squeue --me, and let them run with scontrol release JOB, or scancel JOB and give the same command with --resume";

/// Numbers of the campaign's tasks that wait or run, and whether Slurm holds them back until somebody releases them.
fn queued(name: &str) -> Result<BTreeMap<usize, bool>> {
    let said = answer(
        "squeue",
        &[
            "--noheader",
            "--array",
            "--me",
            "--name",
            name,
            "--format=%K %T %r",
        ],
    )?;
    // a banner's lines are no tasks
    let task = |line: &str| {
        let (task, state) = line.trim().split_once(' ')?;
        let (state, reason) = state.split_once(' ').unwrap_or((state, ""));
        let is_state = |b: u8| b.is_ascii_uppercase() || b == b'_';
        let task = task.parse().ok().filter(|_| state.bytes().all(is_state))?;
        let is_held = HELD.iter().any(|h| reason.to_lowercase().contains(h));
        Some((task, is_held))
    };
    Ok(said.lines().filter_map(task).collect())
}

/// Look at the runs until none of the campaign's tasks is queued that would run; whether some are held back.
fn watch(campaign: &Campaign, progress: &dyn Progress) -> Result<bool> {
    let all = campaign.plan.runs.len();
    progress.begin("runs", Some(all as u64));
    let mut stepped = 0;
    let mut silences = 0;
    let name = name(&campaign.places, &campaign.plan.name);
    let is_held = loop {
        let queue = queued(&name);
        let manifest = manifest::write(campaign)?;
        let done = manifest.count(RunState::Done) + manifest.count(RunState::Failed);
        for _ in stepped..done {
            progress.step();
        }
        stepped = stepped.max(done);
        match queue {
            Ok(queue) if queue.values().all(|held| *held) => break !queue.is_empty(),
            Ok(_) => silences = 0,
            Err(e) if silences >= SILENCES => return Err(e),
            Err(_) => silences += 1,
        }
        std::thread::sleep(PATIENCE);
    };
    progress.end();
    Ok(is_held)
}

/// What a command of Slurm prints.
fn answer(program: &str, arguments: &[&str]) -> Result<String> {
    let wanted = || Error::input(program, "an answer of Slurm");
    let output = Command::new(program).args(arguments).output();
    let output = output.map_err(|e| {
        wanted().found(e).hint(
            "this machine has no Slurm: --engine local, or --task K --of N under another scheduler",
        )
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let error = wanted().found(said.trim());
        let lower = said.to_lowercase();
        let remedy = REMEDIES.iter().find(|(words, _)| lower.contains(words));
        return Err(match remedy {
            Some((_, hint)) => error.hint(hint),
            None => error,
        });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
