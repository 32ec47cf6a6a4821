//! Where results go: text for people, or one JSON value with `--json`.

use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::console::styled;
use super::{Command, Global};
use crate::error::{Error, Result};

/// Whether results are printed as JSON. It is set once, before a verb begins.
static JSON: AtomicBool = AtomicBool::new(false);

/// Settle how results are printed.
///
/// # Errors
/// The input's fault: `--json` with a verb that has no results.
pub(super) fn prepare(global: &Global, verb: &Command) -> Result<()> {
    if global.json && !has_results(verb) {
        return Err(Error::input("--json", "a command that prints results")
            .found("one that writes files")
            .hint("loop, identify, trace, build, diagnose, validate, campaign, design, fringes and effects have --json"));
    }
    JSON.store(global.json, Ordering::Relaxed);
    Ok(())
}

/// Whether a verb prints results, and not only what it wrote or how to use it.
fn has_results(verb: &Command) -> bool {
    !matches!(
        verb,
        Command::Export(_)
            | Command::Report(_)
            | Command::DesignOfExperiments(_)
            | Command::Simulate(_)
            | Command::Init(_)
            | Command::Help(_)
    )
}

/// Print text to standard output, unless results are printed as JSON.
pub(super) fn print(text: &str) -> Result<()> {
    match JSON.load(Ordering::Relaxed) {
        true => Ok(()),
        false => write(&styled(text)),
    }
}

/// Print results to standard output as JSON, where that is asked for.
///
/// # Errors
/// The input's fault: an output that cannot be written. The program's: a value that JSON cannot hold.
pub(super) fn results(value: &impl Serialize) -> Result<()> {
    if !JSON.load(Ordering::Relaxed) {
        return Ok(());
    }
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| Error::program("--json", "numbers that JSON can hold").found(e))?;
    write(&(text + "\n"))
}

/// A reader that has seen enough (`| head`) is no error.
fn write(text: &str) -> Result<()> {
    let mut out = anstream::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Error::input("standard output", "a place that can be written").found(e))
        }
        _ => Ok(()),
    }
}
