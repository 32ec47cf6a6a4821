//! One run as a process of its own: held by a lock, its output in a log, its end noted.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use super::children::Children;
use super::engine::Campaign;
use super::run::Run;
use super::status::RunState;
use crate::error::{Error, Result, TO_BE_RESUMED};

/// Take up a run if it is still missing. False if another process holds it.
///
/// # Errors
/// Of the input: a folder that cannot be written, a program that cannot be started.
pub fn take_up(
    campaign: &Campaign,
    run: &Run,
    command: &mut Command,
    children: &Children,
) -> Result<bool> {
    let places = &campaign.places;
    let Some(lock) = places.take(&run.name)? else {
        return Ok(false);
    };
    let mut status = places.noted(&run.name);
    if places.is_finished(run) {
        if status.state != RunState::Done {
            status.state = RunState::Done;
            status.cause = None;
            places.note(&run.name, &status)?;
        }
        return Ok(true);
    }
    status.attempts += 1;
    status.version = env!("CARGO_PKG_VERSION").into();
    status.state = RunState::Running;
    status.cause = None;
    places.note(&run.name, &status)?;
    if let Some(file) = run.changed_input() {
        status.state = RunState::Failed;
        status.cause = Some(format!("{file} changed since the campaign was planned"));
        return places.note(&run.name, &status).map(|()| true);
    }
    let began = Instant::now();
    let (end, printed) = executed(&places.log(&run.name), lock, command, children)?;
    status.seconds += began.elapsed().as_secs_f64();
    let Some(end) = end else {
        status.attempts -= 1;
        status.state = match status.attempts {
            0 => RunState::Waiting,
            _ => RunState::ToBeResumed,
        };
        return places.note(&run.name, &status).map(|()| true);
    };
    (status.state, status.cause) = judged(end, &printed, children.stopped());
    if status.state == RunState::Done && run.share.is_none() && !places.is_finished(run) {
        let cause = "the program ended well and left no report";
        (status.state, status.cause) = (RunState::Failed, Some(cause.into()));
    }
    places.note(&run.name, &status)?;
    Ok(true)
}

/// How a process ended, if it was begun, and what it printed. The lock is its standard input, which is empty: whatever becomes of this
/// process, the lock is held as long as that one runs.
fn executed(
    log: &Path,
    lock: File,
    command: &mut Command,
    children: &Children,
) -> Result<(Option<ExitStatus>, String)> {
    let failed = |e: std::io::Error| {
        Error::input(log.display(), "a file that can be read and written").found(e)
    };
    let mut file = File::options()
        .read(true)
        .append(true)
        .create(true)
        .open(log)
        .map_err(failed)?;
    let before = file.seek(SeekFrom::End(0)).map_err(failed)?;
    let [out, error] = [file.try_clone(), file.try_clone()];
    command
        .stdin(Stdio::from(lock))
        .stdout(Stdio::from(out.map_err(failed)?))
        .stderr(Stdio::from(error.map_err(failed)?));
    let end = children.run(command);
    // the command keeps what it was given, the lock too
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let end = end.map_err(|e| {
        let program = command.get_program().to_string_lossy().into_owned();
        Error::input(program, "a program that can be started").found(e)
    })?;
    let mut printed = Vec::new();
    file.seek(SeekFrom::Start(before))
        .and_then(|_| file.read_to_end(&mut printed))
        .map_err(failed)?;
    Ok((end, String::from_utf8_lossy(&printed).into_owned()))
}

/// The state of a run whose process ended so, and the cause if it is not done.
fn judged(end: ExitStatus, printed: &str, stopped: bool) -> (RunState, Option<String>) {
    match end.code() {
        Some(0) => (RunState::Done, None),
        Some(code) if code == i32::from(TO_BE_RESUMED) => {
            (RunState::ToBeResumed, Some("told to stop".into()))
        }
        // one that was sent before the program could take it is a request to stop
        None if stopped => (RunState::ToBeResumed, Some("told to stop".into())),
        None => match signal(end) {
            // from outside (HUP, INT, KILL, TERM): no fault of the run's
            Some(n @ (1 | 2 | 9 | 15)) => {
                let cause = format!("killed by signal {n}: by hand, or for want of memory");
                (RunState::ToBeResumed, Some(cause))
            }
            n => {
                let n = n.map_or_else(|| "a signal".into(), |n| format!("signal {n}"));
                let telling =
                    |l: &&str| l.starts_with("memory allocation of") || l.contains(" panicked at ");
                let said = printed.lines().find(telling).or_else(|| last(printed));
                let said = said.unwrap_or("nothing printed");
                (RunState::Failed, Some(format!("ended by {n}: {said}")))
            }
        },
        Some(code) => {
            let error = printed.lines().rev().find(|l| l.starts_with("error:"));
            let said = error.or_else(|| last(printed));
            let said = said.unwrap_or("nothing printed");
            (RunState::Failed, Some(format!("exit {code}: {said}")))
        }
    }
}

/// The last line that was printed.
fn last(printed: &str) -> Option<&str> {
    printed.lines().rev().find(|l| !l.trim().is_empty())
}

#[cfg(unix)]
fn signal(end: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&end)
}

#[cfg(not(unix))]
fn signal(_end: ExitStatus) -> Option<i32> {
    None
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+%@".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.into(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
