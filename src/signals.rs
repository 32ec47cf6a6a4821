//! Being told to stop: SIGTERM, as a scheduler sends it before a job's time is over. A limit of files' sizes becomes an error of writing.

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

/// A file beyond the size that is allowed (`ulimit -f`) is an error of what writes it, instead of the process's end (SIGXFSZ).
///
/// # Errors
/// Of the program: a system that takes no handler.
#[cfg(unix)]
pub fn survive_file_limit() -> Result<()> {
    let failed = |e: std::io::Error| Error::program("SIGXFSZ", "a signal handler").found(e);
    let flag = std::sync::Arc::default();
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, flag).map_err(failed)?;
    Ok(())
}

/// Where there are no signals there is no such end.
#[cfg(not(unix))]
pub fn survive_file_limit() -> Result<()> {
    Ok(())
}
