//! Being told to stop: SIGTERM, as a scheduler sends it before a job's time is over.

#[cfg(unix)]
use crate::error::Error;
use crate::error::Result;

/// Act once when the process is told to stop (SIGTERM), in a thread of its own, instead of dying of it.
///
/// # Errors
/// Of the program: a system that takes no handler.
#[cfg(unix)]
pub fn on_termination(act: impl FnOnce() + Send + 'static) -> Result<()> {
    use signal_hook::consts::SIGTERM;
    let failed = |e: std::io::Error| Error::program("SIGTERM", "a signal handler").found(e);
    let mut signals = signal_hook::iterator::Signals::new([SIGTERM]).map_err(failed)?;
    std::thread::spawn(move || {
        if signals.forever().next().is_some() {
            act();
        }
    });
    Ok(())
}

/// Where there are no signals nothing is waited for.
#[cfg(not(unix))]
pub fn on_termination(_act: impl FnOnce() + Send + 'static) -> Result<()> {
    Ok(())
}
