//! `plychain campaign population`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{Global, print};
use crate::campaign::Places;
use crate::campaign::population::{PopulationReport, Specimen, gather, sample, write};
use crate::error::{Error, Result};
use crate::report::section::terminal;

/// Arguments of `campaign population`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain campaign population runs/coupons --leave-out coupon-3")]
pub struct PopulationArguments {
    /// Folder of a campaign
    folder: PathBuf,
    /// Leave a run out, as one that is of another material or was damaged
    #[arg(long, value_name = "RUN")]
    leave_out: Vec<String>,
    /// Sd of a scale of all moduli that all specimens share, as of one load cell, percent: it is taken out of each specimen and put to the
    /// population
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0)]
    shared_percent: f64,
}

pub fn run(arguments: &PopulationArguments, global: &Global, console: &Console) -> Result<()> {
    let places = Places(arguments.folder.clone());
    let gathered = gather(&places, &arguments.leave_out)?;
    let percent = arguments.shared_percent;
    if !(0.0..20.0).contains(&percent) {
        return Err(Error::input("--shared-percent", "a percentage from 0 to 20").found(percent));
    }
    let shared = 0.01 * percent;
    let without_shared_scale = |s: Specimen| {
        if shared > 0.0 {
            s.without_scale(shared)
        } else {
            Ok(s)
        }
    };
    let specimens: Vec<Specimen> = gathered
        .specimens
        .into_iter()
        .map(without_shared_scale)
        .collect::<Result<_>>()?;
    let within = arguments.folder.display();
    let sampled = sample(&specimens, shared, global.seed, console).map_err(|e| e.within(within))?;
    let mut report =
        PopulationReport::new(&gathered.name, (global.seed, shared), &sampled, &specimens)?;
    report.left_out = gathered.left_out;
    let page = write(&report, &sampled, &arguments.folder.join("population"))?;
    print(&terminal(&[report.section()]))?;
    print(&format!("written to {}\n", page.display()))
}
