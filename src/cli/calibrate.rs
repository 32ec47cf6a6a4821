//! The parts of `plychain validate` that simulate: the article's setting on a twin, and calibration.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::Console;
use super::{cache, print, results};
use crate::effect::amplitude_name;
use crate::error::{Error, Result};
use crate::files;
use crate::identify;
use crate::infer::Model;
use crate::report::calibration::{
    calibration_numbers, calibration_section, loop_numbers, loop_section, verdicts_numbers,
    verdicts_section,
};
use crate::sample::Laplace;
use crate::section::{Section, terminal};
use crate::validate::calibration::{self, ReplicatePlan};
use crate::validate::grid::PosteriorGrid;
use crate::validate::record::Share;
use crate::validate::twin::{Twin, TwinTruth};
use crate::validate::verdicts::{self, VerdictPlan, VerdictSummary, verdicts};
use crate::validate::whole_loop::{self, LoopSummary};
use crate::validate::{article, quadrature};
use serde_json::{Value, json};

/// Noise of the article's simulated twin, nm, and points along a side.
const TWIN_NOISE_NM: f64 = 10.0;
const TWIN_GRID: usize = 121;

/// The article's setting: its specimen simulated at the means of Table 6, priors of Table 4 cut at Table 5, 0.4 % of
/// unnamed error, a grid over the cut.
pub fn article_twin(
    model: &Model,
    seed: u64,
    nodes: usize,
    console: &Console,
) -> Result<quadrature::GridMoments> {
    if model.constants() != article::NAMES || !model.sampled().is_empty() {
        return Err(Error::input(
            "--article",
            "a laminate without mechanical effects, as the article's",
        )
        .found(&model.file.name)
        .hint("use models/openhole.json"));
    }
    let prepared = identify::prepare(model, &cache(), console)?;
    let twin = Twin::new(model, prepared, TWIN_GRID)?;
    let truth = TwinTruth {
        theta: article::MEAN.to_vec(),
        thickness_mm: model.experiment().specimen.thickness_mm.mean,
        additive: Vec::new(),
        noise_nm: TWIN_NOISE_NM,
    };
    let u = twin.finite_elements(&truth)?;
    let noise = twin.noise(TWIN_NOISE_NM, 0.0, seed);
    let posterior = twin.posterior(model, u, &noise)?.posed.density;
    let mut marginals = posterior.marginals().to_vec();
    for (m, cut) in marginals.iter_mut().zip(article::TRUNCATION) {
        m.truncate = Some(cut);
    }
    let mode: Laplace = identify::start(&posterior)?;
    let posterior = posterior.with_marginals(marginals);
    Ok(PosteriorGrid::new(&posterior, &mode, &article::TRUNCATION, nodes)?.moments)
}

/// Arguments of `validate --sbc` and `validate --verdicts`.
#[derive(Debug, Args)]
pub struct CalibrationArguments {
    /// Calibrate instead: simulate N measurements for each --correlation-mm and identify them. It continues the records in --out
    #[arg(long, value_name = "N", group = "simulated", value_parser = clap::value_parser!(u32).range(1..))]
    sbc: Option<u32>,
    /// Count right and wrong verdicts instead: simulate N measurements with none to --effects effects and close the loop on each. It continues
    /// the records in --out
    #[arg(long, value_name = "N", group = "simulated", value_parser = clap::value_parser!(u32).range(1..))]
    verdicts: Option<u32>,
    /// With --verdicts, maximum number of effects that act
    #[arg(long, value_name = "K", default_value_t = verdicts::MOST, requires = "verdicts")]
    effects: usize,
    /// With --sbc, calibrate the whole loop: draw effects too, and check the intervals that the loop reports. With --verdicts, sample these
    /// intervals too, instead of their closed form
    #[arg(long = "loop", requires = "simulated")]
    whole_loop: bool,
    /// With --sbc --loop, withhold the effect that acts from the dictionary
    #[arg(long, requires_all = ["sbc", "whole_loop"])]
    withheld: bool,
    /// With --sbc or --verdicts, correlation lengths of the noise, mm; 0 is white noise
    #[arg(long, value_delimiter = ',', default_value = "0,1")]
    correlation_mm: Vec<f64>,
    /// With --sbc or --verdicts, number of points along a side of the simulated field
    #[arg(long, default_value_t = 61)]
    grid: usize,
    /// With --sbc or --verdicts, run only share K of N. The same command without --task makes the table
    #[arg(long, value_name = "K", requires_all = ["of", "simulated"], value_parser = clap::value_parser!(u32).range(1..))]
    task: Option<u32>,
    /// Number of shares, N
    #[arg(long, value_name = "N", requires = "task", value_parser = clap::value_parser!(u32).range(1..))]
    of: Option<u32>,
}

/// A calibration before its first replicate: what is calibrated, and a plan for each correlation length of the noise.
pub struct CalibrationPlan {
    what: Calibrated,
    plans: Vec<ReplicatePlan>,
}

/// What is calibrated.
#[derive(Clone, Copy)]
enum Calibrated {
    Identification,
    Loop { withheld: bool },
    Verdicts(VerdictPlan),
}

impl CalibrationArguments {
    pub fn is_asked_for(&self) -> bool {
        self.sbc.or(self.verdicts).is_some()
    }

    /// What is asked for, if a calibration is.
    ///
    /// # Errors
    /// The input's fault, with the option.
    pub fn plan(&self, seed: u64) -> Result<Option<CalibrationPlan>> {
        let Some(replicates) = self.sbc.or(self.verdicts) else {
            return Ok(None);
        };
        let share = self.share()?;
        let plan = |&correlation_mm: &f64| {
            if !(0.0..=2.0).contains(&correlation_mm) {
                return Err(Error::input(
                    "--correlation-mm",
                    "lengths from 0 to 2 mm, which count as noise",
                )
                .found(correlation_mm));
            }
            Ok(ReplicatePlan {
                replicates: replicates as usize,
                correlation_mm,
                seed,
                grid: self.grid,
                share,
            })
        };
        let what = match (self.verdicts, self.whole_loop) {
            (Some(_), whole) => Calibrated::Verdicts(VerdictPlan {
                effects: self.effects,
                whole,
            }),
            (None, true) => Calibrated::Loop {
                withheld: self.withheld,
            },
            (None, false) => Calibrated::Identification,
        };
        let plans = self
            .correlation_mm
            .iter()
            .map(plan)
            .collect::<Result<_>>()?;
        Ok(Some(CalibrationPlan { what, plans }))
    }

    /// The share of the replicates.
    fn share(&self) -> Result<Option<Share>> {
        let Some((task, of)) = self.task.zip(self.of) else {
            return Ok(None);
        };
        if task > of {
            return Err(Error::input("--task", format!("a number from 1 to {of}")).found(task));
        }
        Ok(Some(Share {
            task: task as usize,
            of: of as usize,
        }))
    }
}

/// Run `--sbc` or `--verdicts`.
pub fn calibrate(
    calibration: &CalibrationPlan,
    out: Option<&Path>,
    model: &Model,
    console: &Console,
) -> Result<()> {
    let model = calibration::model_of(model);
    let out = out.map_or_else(
        || {
            let what = match calibration.what {
                Calibrated::Verdicts(_) => "verdicts",
                Calibrated::Identification | Calibrated::Loop { .. } => "sbc",
            };
            PathBuf::from(super::RUNS).join(format!("{}-{what}", model.file.name))
        },
        Path::to_path_buf,
    );
    files::make_folder(&out)?;
    let plans = &calibration.plans;
    match calibration.what {
        Calibrated::Loop { withheld } => {
            let what = if withheld { "withheld" } else { "loop" };
            let found = |plan: &ReplicatePlan, record: &Path| {
                whole_loop::calibrate_loop(&model, plan, withheld, &cache(), record, console)
            };
            let table = |plan: &ReplicatePlan, found: Vec<_>| {
                let summary = LoopSummary::new(&model, plan, withheld, &found);
                (loop_section(&summary), loop_numbers(&summary))
            };
            let all = each(plans, (&out, &format!("sbc-{what}")), (&found, &table))?;
            finish(&out, "calibration_of_the_loop", all)
        }
        Calibrated::Verdicts(asked) => {
            let found = |plan: &ReplicatePlan, record: &Path| {
                verdicts(&model, plan, asked, (&cache(), record), console)
            };
            let table = |plan: &ReplicatePlan, found: Vec<_>| {
                let summary = VerdictSummary::new(plan, asked, &found);
                (verdicts_section(&summary), verdicts_numbers(&summary))
            };
            let all = each(plans, (&out, "verdicts"), (&found, &table))?;
            finish(&out, "verdicts", all)
        }
        Calibrated::Identification => {
            let prepared = identify::prepare(&model, &cache(), console)?;
            let grid = plans.first().map_or(TWIN_GRID, |p| p.grid);
            let twin = Twin::new(&model, prepared, grid)?;
            let names = names(&model);
            let found = |plan: &ReplicatePlan, record: &Path| {
                calibration::calibrate(&model, &twin, plan, record, console)
            };
            let table = |plan: &ReplicatePlan, found: Vec<_>| {
                let summary = calibration::summarise(plan, &names, &found);
                (calibration_section(&summary), calibration_numbers(&summary))
            };
            let all = each(plans, (&out, "sbc"), (&found, &table))?;
            finish(&out, "calibration", all)
        }
    }
}

/// The replicates of a plan, of which there is a record.
type Replicated<'a, T> = &'a dyn Fn(&ReplicatePlan, &Path) -> Result<Vec<T>>;

/// What a plan's replicates say, as a table and as numbers.
type Summarised<'a, T> = &'a dyn Fn(&ReplicatePlan, Vec<T>) -> (Section, Value);

/// Run each plan, and print its table, which a share has none of; the numbers of the tables. Records lie in a folder, under a name.
fn each<T>(
    plans: &[ReplicatePlan],
    (out, name): (&Path, &str),
    (found, table): (Replicated<'_, T>, Summarised<'_, T>),
) -> Result<Vec<Value>> {
    let mut all = Vec::new();
    for plan in plans {
        let record = out.join(format!("{name}-{}mm.jsonl", plan.correlation_mm));
        let found = found(plan, &record)?;
        if plan.share.is_some() {
            print(&format!(
                "{} of {} replicates done, {} mm; the same command without --task makes the table\n",
                found.len(),
                plan.replicates,
                plan.correlation_mm
            ))?;
            continue;
        }
        let (section, numbers) = table(plan, found);
        print(&terminal(&[section]))?;
        all.push(numbers);
    }
    Ok(all)
}

/// What is sampled.
fn names(model: &Model) -> Vec<String> {
    let constants = model.constants().iter().map(|n| (*n).to_string());
    let sampled = model.sampled().into_iter().flat_map(|effect| {
        let parameters = effect.parameters().iter();
        parameters.map(move |p| amplitude_name(effect, p))
    });
    let noise = std::iter::once(crate::parameter::NOISE.into());
    constants.chain(sampled).chain(noise).collect()
}

/// Write the tables, if there are any: a share has none.
fn finish(out: &Path, key: &str, all: Vec<Value>) -> Result<()> {
    if all.is_empty() {
        return Ok(());
    }
    let value = json!({ "schema": crate::report::validation::SCHEMA, key: all });
    let path = out.join("validation.json");
    files::write_json(&path, &value)?;
    results(&value)?;
    print(&format!("written to {}\n", path.display()))
}
