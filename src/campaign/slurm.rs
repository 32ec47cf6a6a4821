//! Runs on a cluster: one job array of Slurm, a share of the runs a task. What is queued is asked of `squeue`, which knows it with and
//! without accounting; what became of a run is in the run's own files. `sacct`, where accounting is on, adds how tasks ended.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::process::Command;
use std::time::Duration;

use sha2::{Digest, Sha256};

use super::engine::{Campaign, Engine};
use super::manifest;
use super::process::quoted;
use super::status::State;
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
        let queued = queued(campaign)?;
        let missing: BTreeSet<usize> = tasks(campaign)
            .into_iter()
            .filter(|k| !queued.contains(k) && is_missing(campaign, *k))
            .collect();
        if missing.is_empty() {
            progress.begin(
                &format!("nothing to submit, {} tasks queued", queued.len()),
                None,
            );
        } else {
            let job = submit(campaign, &missing)?;
            progress.begin(
                &format!("job {job}: {} tasks submitted", missing.len()),
                None,
            );
        }
        progress.end();
        if campaign.resources.cluster.wait {
            watch(campaign, progress)?;
        }
        let manifest = manifest::write(campaign)?;
        let left = manifest.count(State::ToBeResumed) + manifest.count(State::Waiting);
        match campaign.resources.cluster.wait && left > 0 {
            true => Err(
                Error::stopped(campaign.places.0.display(), "runs that come to their end")
                    .found(format!("{left} to be resumed{}", ends(campaign)))
                    .hint("the same command with --resume submits them again"),
            ),
            false => Ok(()),
        }
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
fn name(campaign: &Campaign) -> String {
    let folder = campaign.places.0.display().to_string();
    let mark = hex(&Sha256::digest(folder));
    format!("plychain-{}-{}", campaign.plan.name, &mark[..8])
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
    option("job-name", &name(campaign));
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

/// The number of the job that was submitted.
fn submit(campaign: &Campaign, tasks: &BTreeSet<usize>) -> Result<String> {
    let folder = campaign.places.0.join("slurm");
    files::make_folder(&folder)?;
    let path = folder.join("script.sh");
    files::replace(&path, script(campaign, tasks)?)?;
    let path = path.display().to_string();
    let said = answer("sbatch", &["--parsable", &path])?;
    Ok(said.trim().split(';').next().unwrap_or_default().into())
}

/// Tasks of the campaign that wait or run.
fn queued(campaign: &Campaign) -> Result<BTreeSet<usize>> {
    let name = name(campaign);
    let said = answer(
        "squeue",
        &[
            "--noheader",
            "--array",
            "--me",
            "--name",
            &name,
            "--format=%K %T",
        ],
    )?;
    let task = |line: &str| line.split_whitespace().next()?.parse().ok();
    Ok(said.lines().filter_map(task).collect())
}

/// How tasks ended that did not end well, as far as accounting knows.
fn ends(campaign: &Campaign) -> String {
    let name = format!("--name={}", name(campaign));
    let wanted = [
        "--noheader",
        "--parsable2",
        "--allocations",
        "--format=JobID,State",
        &name,
    ];
    let said = answer("sacct", &wanted).unwrap_or_default();
    let well = ["COMPLETED", "RUNNING", "PENDING"];
    let ended = |line: &str| {
        let (job, state) = line.split_once('|')?;
        let ill = !state.is_empty() && !well.contains(&state);
        ill.then(|| format!("; task {job} {state}"))
    };
    said.lines().filter_map(ended).collect()
}

/// Look at the runs until none of the campaign's tasks is queued.
fn watch(campaign: &Campaign, progress: &dyn Progress) -> Result<()> {
    let all = campaign.plan.runs.len();
    progress.begin("runs", Some(all as u64));
    let mut stepped = 0;
    let mut silences = 0;
    loop {
        let queue = queued(campaign);
        let manifest = manifest::write(campaign)?;
        let done = manifest.count(State::Done) + manifest.count(State::Failed);
        for _ in stepped..done {
            progress.step();
        }
        stepped = stepped.max(done);
        match queue {
            Ok(tasks) if tasks.is_empty() => break,
            Ok(_) => silences = 0,
            Err(e) if silences >= SILENCES => return Err(e),
            Err(_) => silences += 1,
        }
        std::thread::sleep(PATIENCE);
    }
    progress.end();
    Ok(())
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
        return Err(wanted().found(String::from_utf8_lossy(&output.stderr).trim()));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
