//! `plychain campaign population`.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{Global, print, results};
use crate::campaign::CampaignPlaces;
use crate::campaign::population::{
    LEAST, PopulationReport, Specimen, gather, sample, unlike, write,
};
use crate::error::{Error, Result};
use crate::section::terminal;

/// Arguments of `campaign population`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  plychain campaign population runs/coupons --leave-out coupon-3")]
pub struct PopulationArguments {
    /// Folder of a campaign
    folder: PathBuf,
    /// Run to leave out, for example of a damaged specimen; may be repeated
    #[arg(long, value_name = "RUN")]
    leave_out: Vec<String>,
    /// Sd of an error that all specimens share, for example of one load cell, percent of the moduli, 0 to 20. It counts once for the population
    /// and not for each specimen
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0)]
    shared_percent: f64,
}

pub fn run(arguments: &PopulationArguments, global: &Global, console: &Console) -> Result<()> {
    let places = CampaignPlaces(arguments.folder.clone());
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
    let found = unlike(&specimens);
    let is_like = |s: &&Specimen| found.iter().all(|u| u.specimen != s.name);
    let others: Vec<Specimen> = specimens.iter().filter(is_like).cloned().collect();
    let without = (!found.is_empty() && others.len() >= LEAST).then(|| {
        let sampled = sample(&others, shared, global.seed, console)?;
        PopulationReport::new(&gathered.name, (global.seed, shared), &sampled, &others)
    });
    report.say_unlike(&found, without.transpose()?.as_ref());
    report.warnings.extend(gathered.notes);
    report.left_out = gathered.left_out;
    let page = write(&report, &sampled, &arguments.folder.join("population"))?;
    results(&report)?;
    print(&terminal(&[report.section()]))?;
    print(&format!("written to {}\n", page.display()))
}
