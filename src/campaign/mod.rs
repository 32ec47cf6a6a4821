//! Many runs: of models, data and seeds, on this machine or by a cluster's job array, each in an ordinary run folder.

mod calibration;
mod children;
pub mod collect;
mod declared;
mod engine;
pub mod file;
mod local;
pub mod manifest;
pub mod pattern;
mod plan;
pub mod population;
mod process;
mod run;
mod settle;
mod slurm;
mod status;
pub mod sweep;

use crate::error::{Error, Result};

pub use engine::{Campaign, Cluster, Engine, Resources};
pub use run::Run;
pub use settle::{Asked, name_of, settle};
pub use slurm::in_queue;
pub use status::{CampaignPlaces, RunState};

/// Every engine.
pub const ENGINES: &[&dyn Engine] = &[&local::Local, &slurm::Slurm];

/// The engine of a name.
///
/// # Errors
/// The input's fault: there is none.
pub fn engine(name: &str) -> Result<&'static dyn Engine> {
    let found = ENGINES.iter().find(|e| e.name() == name).copied();
    found.ok_or_else(|| Error::one_of("--engine", ENGINES.iter().map(|e| e.name()), name))
}
