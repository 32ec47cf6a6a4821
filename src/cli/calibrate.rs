//! `plychain validate --calibrate`: simulated measurements, and what is quoted of them.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::{print, results};
use crate::error::{Error, Result};
use crate::files;
use crate::infer::Model;
use crate::report::calibration::{calibration_numbers, calibration_section};
use crate::report::validation::SCHEMA;
use crate::section::terminal;
use crate::validate::calibration::calibrate;
use crate::validate::coverage::CalibrationSummary;
use crate::validate::plan::CalibrationPlan;

/// Arguments of `validate --calibrate`.
#[derive(Debug, Args)]
pub struct CalibrationArguments {
    /// Calibrate instead: draw constants, force, thickness, declared effects and noise from their priors, simulate N measurements for each
    /// --correlation-mm, and identify them. It continues the replicates in --out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    calibrate: Option<u32>,
    /// With --calibrate, draw effects too that the model does not declare, close the loop on each measurement, and count names and verdicts
    #[arg(long = "loop", requires = "calibrate")]
    whole_loop: bool,
    /// With --loop, 0 to K effects act, any number equally often, each of one to two plausible sizes (default: as the loop expects them)
    #[arg(long, value_name = "K", requires = "whole_loop")]
    effects: Option<usize>,
    /// With --loop, withhold an effect that acts from the dictionary
    #[arg(long, requires = "whole_loop")]
    withheld: bool,
    /// With --calibrate, correlation lengths of the noise, mm; 0 is white noise
    #[arg(long, value_delimiter = ',', default_value = "0,1")]
    correlation_mm: Vec<f64>,
    /// With --calibrate, number of points along a side of the simulated field
    #[arg(long, default_value_t = 61)]
    grid: usize,
    /// With --calibrate, run only share K of N. The same command without --task makes the table
    #[arg(long, value_name = "K", requires_all = ["of", "calibrate"], value_parser = clap::value_parser!(u32).range(1..))]
    task: Option<u32>,
    /// Number of shares, N
    #[arg(long, value_name = "N", requires = "task", value_parser = clap::value_parser!(u32).range(1..))]
    of: Option<u32>,
}

impl CalibrationArguments {
    /// A plan for each correlation length of the noise; none if no calibration is asked for.
    ///
    /// # Errors
    /// The input's fault, with the option.
    pub fn plans(&self, seed: u64) -> Result<Option<Vec<CalibrationPlan>>> {
        let Some(replicates) = self.calibrate else {
            return Ok(None);
        };
        let share = self.task.zip(self.of);
        if let Some((task, of)) = share.filter(|(task, of)| task > of) {
            return Err(Error::input("--task", format!("a number from 1 to {of}")).found(task));
        }
        if !(8..=1000).contains(&self.grid) {
            let expected = "8 to 1000 points along a side";
            return Err(Error::input("--grid", expected).found(self.grid));
        }
        let plan = |&correlation_mm: &f64| {
            if !(0.0..=2.0).contains(&correlation_mm) {
                let expected = "lengths from 0 to 2 mm, which count as noise";
                return Err(Error::input("--correlation-mm", expected).found(correlation_mm));
            }
            Ok(CalibrationPlan {
                replicates: replicates as usize,
                correlation_mm,
                seed,
                grid: self.grid,
                closes_loop: self.whole_loop,
                withheld: self.withheld,
                effects: self.effects,
                share: share.map_or([1, 1], |(task, of)| [task as usize, of as usize]),
            })
        };
        self.correlation_mm
            .iter()
            .map(plan)
            .collect::<Result<_>>()
            .map(Some)
    }
}

/// The folder of a calibration where none is named.
pub fn folder(plans: &[CalibrationPlan], model: &Model) -> PathBuf {
    let closes_loop = plans.iter().any(|plan| plan.closes_loop);
    let what = if closes_loop { "-loop" } else { "" };
    PathBuf::from(super::RUNS).join(format!("{}-calibration{what}", model.file.name))
}

/// Run each plan in a folder and print its table; a share has none.
pub fn run(plans: &[CalibrationPlan], out: &Path, model: &Model, console: &Console) -> Result<()> {
    let mut all = Vec::new();
    for plan in plans {
        let folder = out.join(format!("calibration-{}mm", plan.correlation_mm));
        let found = calibrate(model, plan, &folder, console)?;
        if plan.share != [1, 1] {
            print(&format!(
                "{} of {} replicates done, {} mm; the same command without --task makes the table\n",
                found.len(),
                plan.replicates,
                plan.correlation_mm
            ))?;
            continue;
        }
        let summary = CalibrationSummary::new(&found);
        print(&terminal(&[calibration_section(model, plan, &summary)]))?;
        all.push(calibration_numbers(model, plan, &summary));
    }
    if all.is_empty() {
        return Ok(());
    }
    let value = json!({ "schema": SCHEMA, "calibration": all });
    let path = out.join("validation.json");
    files::write_json(&path, &value)?;
    results(&value)?;
    print(&format!("written to {}\n", path.display()))
}
