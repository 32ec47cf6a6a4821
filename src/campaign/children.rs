//! The processes of runs, which are told to stop when their campaign is.

use std::collections::BTreeSet;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::error::{Result, locked};
use crate::signals::on_termination;

/// Processes that are running.
#[derive(Debug, Default)]
pub struct Children {
    ids: Mutex<BTreeSet<u32>>,
    stopped: AtomicBool,
}

impl Children {
    /// None yet. Those there will be are told to stop when this process is, by SIGTERM, and then no more are begun.
    ///
    /// # Errors
    /// Those of [`on_termination`].
    pub fn ended_with_us() -> Result<Arc<Self>> {
        let children = Arc::new(Self::default());
        let own = Arc::clone(&children);
        on_termination(move || own.stop())?;
        Ok(children)
    }

    /// Whether no more are to be begun.
    pub fn stopped(&self) -> bool {
        self.stopped.load(Ordering::SeqCst)
    }

    fn stop(&self) {
        self.stopped.store(true, Ordering::SeqCst);
        let ids = locked(&self.ids);
        if !ids.is_empty() {
            // an id stays in the list only while its process is not waited for, so that it is nobody else's
            let _ = Command::new("kill")
                .arg("-TERM")
                .args(ids.iter().map(u32::to_string))
                .stderr(Stdio::null())
                .status();
        }
    }

    /// Start a process, and wait for its end. None if it was not begun because there is to be no more.
    ///
    /// # Errors
    /// A process that cannot be started or waited for.
    pub fn run(&self, command: &mut Command) -> std::io::Result<Option<ExitStatus>> {
        let mut child = {
            let mut ids = locked(&self.ids);
            if self.stopped() {
                return Ok(None);
            }
            let child = command.spawn()?;
            ids.insert(child.id());
            child
        };
        self.wait(&mut child).map(Some)
    }

    fn wait(&self, child: &mut Child) -> std::io::Result<ExitStatus> {
        let began = Instant::now();
        loop {
            {
                let mut ids = locked(&self.ids);
                if let Some(status) = child.try_wait().inspect_err(|_| {
                    ids.remove(&child.id());
                })? {
                    ids.remove(&child.id());
                    return Ok(status);
                }
            }
            // an end is seen late by a fiftieth of the time that it took to come, at most
            let pause = began.elapsed() / 50;
            std::thread::sleep(pause.clamp(Duration::from_millis(1), Duration::from_millis(50)));
        }
    }
}
