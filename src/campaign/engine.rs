//! What brings runs to their end.

use std::path::PathBuf;

use super::plan::Plan;
use super::run::Run;
use super::status::{CampaignPlaces, RunState};
use crate::error::Result;
use crate::progress::Progress;

/// A campaign that is run: its plan, its folder, and what may be used for it.
#[derive(Debug)]
pub struct Campaign {
    /// The campaign file, absolute.
    pub file: PathBuf,
    pub places: CampaignPlaces,
    pub plan: Plan,
    pub resources: Resources,
    /// Of the runs that are not done, those that failed too.
    pub retry: bool,
    /// Share K of N, counted from 1.
    pub share: Option<[usize; 2]>,
}

/// What runs may use.
#[derive(Debug, Clone)]
pub struct Resources {
    /// The program.
    pub program: PathBuf,
    /// Threads of a run.
    pub threads: usize,
    /// Runs at a time in one process of the campaign.
    pub at_once: usize,
    /// Address space of a run, GB.
    pub memory_gb: Option<f64>,
    /// What only a cluster asks for.
    pub cluster: Cluster,
}

/// What a cluster's scheduler is told.
#[derive(Debug, Clone)]
pub struct Cluster {
    /// Runs of a task of the array.
    pub runs_a_task: usize,
    /// The scheduler's own words for the time of a task.
    pub time: Option<String>,
    /// Further options of `sbatch`, as they are.
    pub options: Vec<String>,
    /// Wait for the end of the tasks.
    pub wait: bool,
}

impl Campaign {
    /// Runs of share K of N: every N-th.
    pub fn of_share(&self, [k, n]: [usize; 2]) -> Vec<&Run> {
        self.plan.runs.iter().skip(k - 1).step_by(n).collect()
    }

    /// Runs of this process's share.
    pub fn own(&self) -> Vec<&Run> {
        self.of_share(self.share.unwrap_or([1, 1]))
    }

    /// Whether a run still has to be brought to its end; one that runs elsewhere has, too.
    pub fn is_missing(&self, run: &Run) -> bool {
        match self.places.state(run).state {
            RunState::Done => false,
            RunState::Failed => self.retry,
            RunState::Waiting | RunState::Running | RunState::ToBeResumed => true,
        }
    }

    /// Runs that are missing of this process's share.
    pub fn missing(&self) -> Vec<&Run> {
        let own = self.own().into_iter();
        own.filter(|run| self.is_missing(run)).collect()
    }
}

/// A way to run many.
pub trait Engine: Sync {
    fn name(&self) -> &'static str;

    /// What it would do, to be read and run by hand.
    ///
    /// # Errors
    /// Of the input: something that it cannot do.
    fn script(&self, campaign: &Campaign) -> Result<String>;

    /// Bring the missing runs to their end, or hand them on to who does. A run that fails is no error here: it is in its state.
    ///
    /// # Errors
    /// Told to stop; of the input: a folder that cannot be written, a scheduler that does not answer.
    fn run(&self, campaign: &Campaign, progress: &dyn Progress) -> Result<()>;
}
