//! Runs on this machine: processes of the program itself, some at a time.

use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::children::Children;
use super::engine::{Campaign, Engine, Resources};
use super::manifest;
use super::process;
use super::run::Run;
use crate::error::{Error, Result, locked};
use crate::progress::Progress;

pub struct Local;

/// Between two manifests while runs go on.
const PATIENCE: Duration = Duration::from_secs(5);

impl Engine for Local {
    fn name(&self) -> &'static str {
        "local"
    }

    fn script(&self, campaign: &Campaign) -> Result<String> {
        let lines = campaign.missing().into_iter().map(|run| {
            let words = words(&command(campaign, run));
            format!("{words}\n")
        });
        Ok(lines.collect())
    }

    fn run(&self, campaign: &Campaign, progress: &dyn Progress) -> Result<()> {
        let children = Children::ended_with_us()?;
        let own = campaign.own();
        let todo = campaign.missing();
        progress.begin("runs", Some(own.len() as u64));
        for _ in todo.len()..own.len() {
            progress.step();
        }
        let elsewhere = all(campaign, &children, &todo, progress);
        // what is left of a campaign that was killed ends by itself, and is then seen to be done or gone on with
        let ended = elsewhere.and_then(|mut left| {
            while !(left.is_empty() || children.stopped()) {
                std::thread::sleep(Duration::from_millis(300));
                left = all(campaign, &children, &left, progress)?;
            }
            Ok(())
        });
        progress.end();
        manifest::write(campaign)?;
        ended?;
        match children.stopped() {
            false => Ok(()),
            true => Err(Error::stopped(
                campaign.places.0.display(),
                "a campaign that comes to its end",
            )
            .found("SIGTERM")
            .hint("the same command with --resume goes on")),
        }
    }
}

/// Take up each run, some at a time, and return those that other processes hold.
fn all<'a>(
    campaign: &Campaign,
    children: &Children,
    todo: &[&'a Run],
    progress: &dyn Progress,
) -> Result<Vec<&'a Run>> {
    let next = AtomicUsize::new(0);
    let elsewhere = Mutex::new(Vec::new());
    let told = Mutex::new(Instant::now());
    let work = || -> Result<()> {
        while !children.stopped() {
            let Some(&run) = todo.get(next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            match process::take_up(campaign, run, &mut command(campaign, run), children)? {
                true => progress.step(),
                false => locked(&elsewhere).push(run),
            }
            let mut told = locked(&told);
            if told.elapsed() > PATIENCE {
                *told = Instant::now();
                manifest::write(campaign)?;
            }
        }
        Ok(())
    };
    let slots = campaign.resources.at_once.min(todo.len());
    let ends: Vec<Result<()>> = std::thread::scope(|scope| {
        let slots: Vec<_> = (0..slots).map(|_| scope.spawn(work)).collect();
        let failed = || Error::program("campaign", "a thread that comes to its end");
        let ends = slots.into_iter().map(|s| s.join());
        ends.map(|e| e.unwrap_or_else(|_| Err(failed()))).collect()
    });
    ends.into_iter().collect::<Result<()>>()?;
    let elsewhere = elsewhere.into_inner();
    Ok(elsewhere.unwrap_or_else(PoisonError::into_inner))
}

/// The process of a run. A limit of its memory is set by a shell, which the program then replaces.
fn command(campaign: &Campaign, run: &Run) -> Command {
    let Resources {
        program,
        threads,
        memory_gb,
        ..
    } = &campaign.resources;
    let mut command = match memory_gb {
        None => Command::new(program),
        Some(gb) => {
            let kib = (gb * 1e9 / 1024.0).ceil() as u64;
            let mut shell = Command::new("sh");
            shell
                .args(["-c", &format!("ulimit -v {kib} && exec \"$0\" \"$@\"")])
                .arg(program);
            shell
        }
    };
    command.args(run.arguments(&campaign.places.run(run)));
    command.args(["--threads", &threads.to_string()]);
    command
}

/// A command as a shell takes it.
fn words(command: &Command) -> String {
    let all = std::iter::once(command.get_program()).chain(command.get_args());
    let words = all.map(|word| process::quoted(&word.to_string_lossy()));
    words.collect::<Vec<_>>().join(" ")
}
