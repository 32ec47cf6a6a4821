//! Monitor: one line of progress on a terminal, plain lines in a file with `--verbose`, nothing when quiet. Always on standard error. It says
//! what is done and how much there is of it. Of a loop it says beforehand about how long it takes.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, Weak};
use std::time::{Duration, Instant};

use anstyle::{AnsiColor, Style};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::locked;
use crate::progress::{Progress, StageClock, StageCost};

/// Watches work for a person.
pub struct Console {
    mode: ConsoleMode,
    verbose: bool,
    stage: Shared,
    clock: Mutex<StageClock>,
    /// Loops that are to come.
    loops: AtomicUsize,
    /// Seconds that they take, about.
    expected_s: OnceLock<f64>,
}

/// Seconds that the loop of one field takes on two processors, and for each point of all its steps that of a series. Measured: fields of
/// 14 and 480 thousand points 22 and 29 s; series of 36, 36, 36, 46 and 84 thousand 34, 50, 64, 92 and 143 s.
const FIELD_S: f64 = 22.0;
const SERIES_S_PER_POINT: f64 = 1.6e-3;

/// The stage in progress, if there is one, which the heartbeat looks at too.
type Shared = Arc<Mutex<Option<Stage>>>;

#[derive(Clone, Copy, PartialEq)]
enum ConsoleMode {
    Quiet,
    /// Warnings alone.
    Remarks,
    Lines,
    Bars,
}

struct Stage {
    what: String,
    started: Instant,
    steps: Option<u64>,
    done: u64,
    said: String,
    told: Instant,
    bar: Option<ProgressBar>,
}

/// Between two plain lines of one stage.
const PATIENCE: Duration = Duration::from_secs(5);

impl Console {
    /// A console for standard error: one line of progress on a terminal, none in a file; with `verbose` a line for each stage as well.
    pub fn new(quiet: bool, verbose: bool) -> Self {
        let mode = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => ConsoleMode::Quiet,
            (false, true) => ConsoleMode::Bars,
            (false, false) if verbose => ConsoleMode::Lines,
            (false, false) => ConsoleMode::Remarks,
        };
        let stage = Shared::default();
        if mode == ConsoleMode::Lines {
            let stage = Arc::downgrade(&stage);
            std::thread::spawn(move || heartbeat(&stage));
        }
        Self {
            mode,
            verbose,
            stage,
            clock: Mutex::default(),
            loops: AtomicUsize::new(0),
            expected_s: OnceLock::new(),
        }
    }

    /// What is to come are some loops.
    pub fn expect_loops(&self, loops: usize) {
        self.loops.store(loops, Ordering::Relaxed);
    }

    /// How much of the whole run is done, in percent, by the time that was expected.
    fn share(&self) -> String {
        let share = |expected: &f64| 100.0 * self.clock().elapsed_s() / expected;
        let percent = |expected| format!("{:.0} % ", share(expected).min(99.0));
        self.expected_s.get().map(percent).unwrap_or_default()
    }

    /// What the stages cost so far.
    pub fn costs(&self) -> Vec<StageCost> {
        self.clock().costs()
    }

    fn clock(&self) -> MutexGuard<'_, StageClock> {
        locked(&self.clock)
    }

    /// A line of its own, unless all is quiet.
    fn tell(&self, text: &str) {
        let tell = || line(text);
        match self.mode {
            ConsoleMode::Quiet => {}
            ConsoleMode::Remarks => tell(),
            _ => self.with(|stage| match stage.as_ref().and_then(|s| s.bar.as_ref()) {
                Some(bar) => bar.suspend(tell),
                None => tell(),
            }),
        }
    }

    fn with(&self, act: impl FnOnce(&mut Option<Stage>)) {
        if matches!(self.mode, ConsoleMode::Quiet | ConsoleMode::Remarks) {
            return;
        }
        act(&mut locked(&self.stage));
    }
}

/// Tell of a stage that neither ticks nor speaks, until the console is gone.
fn heartbeat(stage: &Weak<Mutex<Option<Stage>>>) {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        let Some(stage) = stage.upgrade() else { return };
        if let Some(stage) = locked(&stage).as_mut() {
            stage.tell();
        }
    }
}

impl Stage {
    /// A plain line now and then, so that a log shows that the work goes on.
    fn tell(&mut self) {
        if self.bar.is_some() || self.told.elapsed() < PATIENCE {
            return;
        }
        self.told = Instant::now();
        let spent = self.started.elapsed().as_secs_f64();
        match self.steps {
            Some(steps) if self.done > 0 => {
                line(&format!(
                    "  {}: {} of {steps}, {spent:.0} s so far",
                    self.what, self.done
                ));
            }
            _ => line(&format!(
                "  {}{}{}, {spent:.0} s so far",
                self.what,
                self.colon(),
                self.said
            )),
        }
    }

    /// What stands between the stage and what it said.
    fn colon(&self) -> &'static str {
        if self.said.is_empty() { "" } else { ": " }
    }
}

impl Progress for Console {
    fn begin(&self, what: &str, steps: Option<u64>) {
        self.clock().begin(what);
        self.with(|stage| {
            let bar = (self.mode == ConsoleMode::Bars).then(|| bar(what, steps));
            if let Some(bar) = &bar {
                bar.set_prefix(self.share());
            }
            let now = Instant::now();
            *stage = Some(Stage {
                what: what.into(),
                started: now,
                steps,
                done: 0,
                said: String::new(),
                told: now,
                bar,
            });
        });
    }

    fn step(&self) {
        self.with(|stage| {
            let Some(stage) = stage else { return };
            stage.done += 1;
            if let Some(bar) = &stage.bar {
                bar.inc(1);
                bar.set_prefix(self.share());
            }
            stage.tell();
        });
    }

    fn say(&self, what: &str) {
        self.with(|stage| {
            let Some(stage) = stage else { return };
            stage.said = what.into();
            if let Some(bar) = &stage.bar {
                bar.set_message(format!("{}: {what}", stage.what));
            }
            stage.tell();
        });
    }

    fn measured(&self, points: usize, steps: usize) {
        let loops = self.loops.load(Ordering::Relaxed);
        if loops == 0 {
            return;
        }
        let processors = rayon::current_num_threads();
        let one = if steps == 1 {
            FIELD_S
        } else {
            SERIES_S_PER_POINT * (points * steps) as f64
        };
        let expected = one * loops as f64 * 2.0 / processors as f64;
        if self.expected_s.set(expected).is_err() {
            return;
        }
        let time = match expected > 100.0 {
            true => format!("{:.0} min", (expected / 60.0).ceil()),
            false => format!("{:.0} s", 5.0 * (expected / 5.0).ceil()),
        };
        self.tell(&format!(
            "about {time} on {processors} processors; half of it with few effects, twice with many"
        ));
    }

    fn warn(&self, sentence: &str) {
        self.tell(&format!("warning: {sentence}"));
    }

    fn end(&self) {
        self.clock().end();
        self.with(|stage| {
            let Some(stage) = stage.take() else { return };
            if let Some(bar) = &stage.bar {
                bar.finish_and_clear();
            }
            if !self.verbose {
                return;
            }
            line(&format!(
                "  {}{}{} ({:.1} s)",
                stage.what,
                stage.colon(),
                stage.said,
                stage.started.elapsed().as_secs_f64()
            ));
        });
    }
}

fn bar(what: &str, steps: Option<u64>) -> ProgressBar {
    let (bar, template) = match steps {
        Some(steps) => (
            ProgressBar::new(steps),
            "  {prefix}{wide_msg} {bar:20.cyan} {pos}/{len}",
        ),
        None => (
            ProgressBar::new_spinner(),
            "  {prefix}{spinner} {wide_msg} {elapsed} so far",
        ),
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(what.to_string());
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Lines that begin like this stand out on a terminal. The streams take the styles out again where there is none, and
/// where `NO_COLOR` is set.
const STANDOUT: &[(&str, AnsiColor)] = &[
    ("error:", AnsiColor::Red),
    ("hint:", AnsiColor::Cyan),
    ("warning:", AnsiColor::Yellow),
    ("BEFORE YOU USE THESE NUMBERS", AnsiColor::Yellow),
    ("NOT converged", AnsiColor::Red),
    ("VERDICT:", AnsiColor::Green),
];

/// Text with the beginnings of its lines in colour.
pub fn styled(text: &str) -> String {
    let line = |line: &str| {
        let known = STANDOUT.iter().find(|(start, _)| line.starts_with(start));
        known.map_or_else(
            || line.to_string(),
            |(start, colour)| {
                let style = Style::new().bold().fg_color(Some((*colour).into()));
                format!("{style}{start}{style:#}{}", &line[start.len()..])
            },
        )
    };
    text.split_inclusive('\n').map(line).collect()
}

/// A line on standard error. Nobody reading it is no reason to stop.
pub fn line(text: &str) {
    let _ = writeln!(anstream::stderr(), "{}", styled(text));
}
