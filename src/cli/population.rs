//! `plychain campaign population`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{Global, print};
use crate::campaign::Places;
use crate::campaign::population::{PopulationReport, gather, sample, write};
use crate::error::Result;

/// Arguments of `campaign population`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain campaign population runs/coupons --leave-out coupon-3")]
pub struct Arguments {
    /// Folder of a campaign
    folder: PathBuf,
    /// Leave a run out, as one that is of another material or was damaged
    #[arg(long, value_name = "RUN")]
    leave_out: Vec<String>,
}

pub fn run(arguments: &Arguments, global: &Global, console: &Console) -> Result<()> {
    let places = Places(arguments.folder.clone());
    let gathered = gather(&places, &arguments.leave_out)?;
    let specimens = &gathered.specimens;
    let within = arguments.folder.display();
    let sampled = sample(specimens, global.seed, console).map_err(|e| e.within(within))?;
    let mut report = PopulationReport::new(&gathered.name, global.seed, &sampled, specimens)?;
    report.left_out = gathered.left_out;
    let page = write(&report, &sampled, &arguments.folder.join("population"))?;
    print(&report.text())?;
    print(&format!("written to {}\n", page.display()))
}
