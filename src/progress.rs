//! How long work tells how far it has come, and what each stage of it cost. The command line draws bars; tests progress nothing.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Watches work in progress.
pub trait Progress: Sync {
    /// A stage begins; `steps` is how many ticks it takes, if that is known.
    fn begin(&self, what: &str, steps: Option<u64>);

    /// One step of the stage is done.
    fn step(&self);

    /// Something worth saying about the stage in a few words.
    fn say(&self, what: &str);

    fn end(&self);

    /// The measurement was read: so many points in so many steps.
    fn measured(&self, _points: usize, _steps: usize) {}

    /// A sentence that a person should read now, in the middle of the work.
    fn warn(&self, _sentence: &str) {}
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _steps: Option<u64>) {}

    fn step(&self) {}

    fn say(&self, _what: &str) {}

    fn end(&self) {}
}

/// What a stage cost, over all times that it was gone through.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageCost {
    pub stage: String,
    pub times: usize,
    /// By the clock on the wall, s.
    pub wall_s: f64,
    /// Of all processors, s; none where the system does not say it.
    pub processor_s: Option<f64>,
}

/// Seconds on the wall and of all processors.
#[derive(Debug, Clone, Copy)]
struct Moment(Instant, Option<f64>);

impl Moment {
    fn now() -> Self {
        Self(Instant::now(), processor_seconds())
    }

    fn since(self, begin: Self) -> (f64, Option<f64>) {
        let processor = self.1.zip(begin.1).map(|(end, begin)| end - begin);
        ((self.0 - begin.0).as_secs_f64(), processor)
    }
}

/// Keeps what stages cost. They follow each other: one that begins ends the one before.
#[derive(Debug)]
pub struct StageClock {
    started: Moment,
    open: Option<(String, Moment)>,
    costs: Vec<StageCost>,
}

impl Default for StageClock {
    fn default() -> Self {
        Self {
            started: Moment::now(),
            open: None,
            costs: Vec::new(),
        }
    }
}

impl StageClock {
    pub fn begin(&mut self, stage: &str) {
        self.end();
        self.open = Some((stage.into(), Moment::now()));
    }

    pub fn end(&mut self) {
        let Some((stage, begin)) = self.open.take() else {
            return;
        };
        let (wall, processor) = Moment::now().since(begin);
        let known = self.costs.iter_mut().find(|c| c.stage == stage);
        match known {
            Some(cost) => {
                cost.times += 1;
                cost.wall_s += wall;
                cost.processor_s = cost.processor_s.zip(processor).map(|(a, b)| a + b);
            }
            None => self.costs.push(StageCost {
                stage,
                times: 1,
                wall_s: wall,
                processor_s: processor,
            }),
        }
    }

    /// Since the beginning, by the clock on the wall.
    pub fn elapsed_s(&self) -> f64 {
        self.started.0.elapsed().as_secs_f64()
    }

    /// The stages so far in the order of their beginnings, and at last what was spent outside of them.
    pub fn costs(&self) -> Vec<StageCost> {
        let (wall, processor) = Moment::now().since(self.started);
        let named = |of: fn(&StageCost) -> f64| self.costs.iter().map(of).sum::<f64>();
        let rest = StageCost {
            stage: "all else".into(),
            times: 1,
            wall_s: wall - named(|c| c.wall_s),
            processor_s: processor.map(|p| p - named(|c| c.processor_s.unwrap_or(0.0))),
        };
        let stages = self.costs.iter().cloned();
        stages.chain(std::iter::once(rest)).collect()
    }
}

/// Processor seconds of this process, as Linux tells them in hundredths.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // a program's name may hold blanks and brackets
    let (_, after) = text.rsplit_once(')')?;
    let mut ticks = after.split_whitespace().skip(11).map(str::parse::<f64>);
    let (user, system) = (ticks.next()?.ok()?, ticks.next()?.ok()?);
    Some((user + system) / 100.0)
}
