//! Simulation-based calibration (Talts et al. 2018): constants, forces, thickness, effects and noise are drawn from their priors, a field or a
//! load series is simulated with all of them on a finer mesh, the model is identified from it, or the loop is closed on it, and the truth is
//! looked for among what is quoted.
//!
//! With 200 replicates each the ranks of the four constants of an identification are uniform (Kolmogorov-Smirnov p between 0.2 and 0.9) and
//! their 90 % intervals hold 86 to 92 % of the truths, with white noise and with noise correlated over 1 mm (two seeds) alike. Those of
//! `noise_nm` are so in white noise (p = 0.7, 88 % held); in noise correlated over 1 mm (p = 0.02 and 0.08, 92 % held) it is a quarter and an
//! eighth of its sd too large on average, as noise correlated over 1 mm might have a white part. The fields were on the model's own mesh.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::drawn::Drawn;
use super::plan::CalibrationPlan;
use crate::chain::Draws;
use crate::diagnose::{mean, sd, sorted};
use crate::error::{Error, Result};
use crate::files::{self, Keyed};
use crate::identify::{Options, identify};
use crate::infer::{EffectUnderLaw, Model};
use crate::linearise::candidates;
use crate::numeric::quantile;
use crate::progress::{Progress, Silent};
use crate::sample::{SAMPLERS, Schedule};
use crate::trace::{Closed, Interval, LoopStage, Status, ToQuote, close};

/// One simulated measurement, and what is quoted of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Replicate {
    pub replicate: usize,
    /// Constants, and whatever else was drawn that the draws know, by name.
    pub parameters: Keyed<Recovered>,
    /// Whether all chains converged.
    pub converged: bool,
    /// What the loop says, if it was closed.
    #[serde(rename = "loop")]
    pub account: Option<LoopAccount>,
}

/// A true value beside what is quoted of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Recovered {
    pub truth: f64,
    #[serde(flatten)]
    pub quoted: Interval,
    /// Share of the draws below the truth; none where the closed form is quoted.
    pub below: Option<f64>,
}

impl Recovered {
    /// Whether the 95 % interval holds the truth.
    pub fn is_held(&self) -> bool {
        (self.quoted.low..=self.quoted.high).contains(&self.truth)
    }
}

/// What acted on a simulated measurement beside what is declared, and what the loop says of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LoopAccount {
    pub acted: Vec<ActedEffect>,
    /// Alias groups that the loop named; one effect where it stands alone.
    pub named: Vec<Vec<String>>,
    pub status: Status,
    /// Whether the account was flagged, and what spans several answers quoted.
    pub flagged: bool,
}

/// An effect that acted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ActedEffect {
    pub effect: String,
    /// How its amplitude goes over the steps of a series.
    pub law: Option<String>,
    /// Whether its first amplitude is so large that the first round would have found it, if nothing else acted.
    pub shows: bool,
}

/// Rounds after which a loop ends.
const ROUNDS: usize = 5;

/// A replicate whose effects cannot act together is drawn anew, so often.
const ATTEMPTS: u64 = 20;

/// The model that is calibrated: unnamed model errors are left out, because nothing of them is simulated.
fn calibrated(model: &Model) -> Model {
    let mut model = model.clone();
    model.file.likelihood.model_error_fraction = 0.0;
    model.file.likelihood.noise_nm = None;
    model
}

/// Do the replicates that a `folder` lacks, as many at a time as there are threads, and return all that it has.
///
/// # Errors
/// Replicates of another plan; what simulation, identification and the loop may fail with.
pub fn calibrate(
    model: &Model,
    plan: &CalibrationPlan,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Vec<Replicate>> {
    let model = &calibrated(model);
    refuse_unknown_forces(model)?;
    files::make_folder(folder)?;
    let records = Records::new(model, plan, folder)?;
    let mut todo = Vec::new();
    for k in plan.own() {
        if records.read(k)?.is_none() {
            todo.push(k);
        }
    }
    progress.begin("calibration", Some(todo.len() as u64));
    for some in todo.chunks(rayon::current_num_threads()) {
        some.par_iter().try_for_each(|&k| {
            let found = replicate(model, plan, k, folder);
            progress.step();
            records.write(&found.map_err(|e| e.within(format!("replicate {k}")))?)
        })?;
    }
    progress.end();
    let all = (0..plan.replicates).filter_map(|k| records.read(k).transpose());
    all.collect()
}

/// Forces cannot be drawn about values that nobody declares.
fn refuse_unknown_forces(model: &Model) -> Result<()> {
    let steps = model.experiment().steps.as_deref().unwrap_or_default();
    let Some(k) = steps.iter().position(|s| s.force_n.is_none()) else {
        return Ok(());
    };
    let place = format!("experiments[0].steps[{k}].force_N");
    Err(
        Error::input(place, "a force in N, about which a calibration draws")
            .found("null")
            .hint("put in the forces that you plan; the files are not read"),
    )
}

/// Replicates that are done: a file each in a folder, so that any number of processes may add to them.
struct Records<'a> {
    folder: &'a Path,
    /// Digest of the format, the plan and the model.
    of: String,
}

/// Format of a record.
const RECORD: &str = "plychain-calibration/1";

/// A replicate's file.
#[derive(Serialize, Deserialize)]
struct Record {
    of: String,
    #[serde(flatten)]
    replicate: Replicate,
}

impl<'a> Records<'a> {
    fn new(model: &Model, plan: &CalibrationPlan, folder: &'a Path) -> Result<Self> {
        // more or fewer replicates of the same plan are the same record
        let any_number = CalibrationPlan {
            replicates: 0,
            ..plan.clone()
        };
        let of = serde_json::to_vec(&(RECORD, any_number, &model.file))
            .map_err(|e| Error::program("calibration", "what JSON can hold").found(e))?;
        let of = files::hex(&Sha256::digest(of))[..16].to_string();
        Ok(Self { folder, of })
    }

    fn path(&self, replicate: usize) -> PathBuf {
        self.folder.join(format!("{replicate}.json"))
    }

    fn read(&self, replicate: usize) -> Result<Option<Replicate>> {
        let path = self.path(replicate);
        let place = path.display().to_string();
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::input(place, "a readable file").found(e)),
        };
        let record: Record = files::parse_json(&text, &place)?;
        match record.of == self.of {
            true => Ok(Some(record.replicate)),
            false => Err(
                Error::input(place, "a replicate of the same model, seed and options")
                    .found("one of others")
                    .hint("choose another --out; nothing was changed"),
            ),
        }
    }

    fn write(&self, replicate: &Replicate) -> Result<()> {
        let record = Record {
            of: self.of.clone(),
            replicate: replicate.clone(),
        };
        files::write_json(&self.path(replicate.replicate), &record)
    }
}

/// Draw and simulate a measurement, and find out what is quoted of it.
fn replicate(
    model: &Model,
    plan: &CalibrationPlan,
    replicate: usize,
    folder: &Path,
) -> Result<Replicate> {
    // each replicate has a place of its own for the measurement
    let place = folder.join(format!("field-{replicate}"));
    let draw = |attempt: u64| -> Result<(Drawn, Model)> {
        let drawn = Drawn::new(model, plan, replicate, attempt);
        let measured = drawn.simulated(model, &place)?;
        Ok((drawn, measured))
    };
    let mut drawn = draw(0);
    for attempt in 1..ATTEMPTS {
        drawn = drawn.or_else(|_| draw(attempt));
    }
    let (drawn, measured) = drawn?;
    let found = found(&measured, plan, (replicate, &drawn));
    // a field that cannot be removed does no harm
    let _ = std::fs::remove_dir_all(&place);
    found
}

/// What is quoted of a measurement.
fn found(
    model: &Model,
    plan: &CalibrationPlan,
    (replicate, drawn): (usize, &Drawn),
) -> Result<Replicate> {
    let sampler = (SAMPLERS[0].build)();
    let options = |stage: LoopStage| {
        let stream = match stage {
            LoopStage::Attempt(attempt) => 100 + attempt as u64,
            LoopStage::Answer(_) => 199,
        };
        let schedule = Schedule {
            seed: plan.seed_of(replicate, stream),
            ..Schedule::default()
        };
        Options {
            schedule,
            ..Options::new(&*sampler)
        }
    };
    let truths = drawn.truths(model);
    if !plan.closes_loop {
        let found = identify(model, &options(LoopStage::Attempt(0)), &Silent)?;
        return Ok(Replicate {
            replicate,
            parameters: recovered(truths, &Keyed::new(), Some(&found.draws)),
            converged: found.verdict.converged,
            account: None,
        });
    }
    let mut model = model.clone();
    if plan.withheld {
        let (all, _) = candidates(&model);
        let lacks = drawn.acted.first().map_or("", |a| a.effect.name());
        let names = all.iter().map(|e| e.name()).filter(|n| *n != lacks);
        model.experiment_mut().candidates = Some(names.map(String::from).collect());
    }
    let closed = close(&model, ROUNDS, &options, &Silent)?;
    let (draws, converged) = match &closed.to_quote {
        ToQuote::Sampled(sampled) => {
            let converged = sampled.answers.iter().all(|a| a.verdict.converged);
            (Some(&sampled.draws), converged)
        }
        ToQuote::ClosedForm(_) => (None, false),
    };
    Ok(Replicate {
        replicate,
        parameters: recovered(truths, &closed.quoted(), draws),
        converged,
        account: Some(LoopAccount::of(&closed, drawn)),
    })
}

/// What is quoted of each true value, or else what the draws have of it.
fn recovered(
    truths: Vec<(String, f64)>,
    quoted: &Keyed<Interval>,
    draws: Option<&Draws>,
) -> Keyed<Recovered> {
    let recovered = |(name, truth): (String, f64)| {
        let values = draws.and_then(|draws| Some(draws.series(draws.index(&name)?).values));
        let of_draws = values.as_ref().map(|values| {
            let ordered = sorted(values);
            let [low, median, high] = [0.025, 0.5, 0.975].map(|p| quantile(&ordered, p));
            Interval {
                mean: mean(values),
                sd: sd(values),
                low,
                median,
                high,
            }
        });
        let below = values.map(|values| {
            let below = values.iter().filter(|x| **x < truth).count();
            below as f64 / values.len() as f64
        });
        let recovered = Recovered {
            truth,
            quoted: quoted.get(&name).copied().or(of_draws)?,
            below,
        };
        Some((name, recovered))
    };
    truths.into_iter().filter_map(recovered).collect()
}

impl LoopAccount {
    fn of(closed: &Closed, drawn: &Drawn) -> Self {
        let sought = &closed.rounds[0].tracing.candidates;
        let acted = |acts: &EffectUnderLaw| {
            let mut sought = sought.iter();
            let own = sought.find(|c| c.effect.name() == acts.effect.name() && c.law == acts.law);
            let size = drawn.amplitude(acts).first().map_or(0.0, |a| a.abs());
            ActedEffect {
                effect: acts.effect.name().to_string(),
                law: acts.law.map(|law| law.key()),
                shows: own.is_some_and(|c| size > c.detectable),
            }
        };
        let conclusion = &closed.conclusion;
        let group = |name: &String| {
            let mut groups = conclusion.alias_groups.iter();
            let own = groups.find(|g| g.contains(name)).cloned();
            own.unwrap_or_else(|| vec![name.clone()])
        };
        Self {
            acted: drawn.acted.iter().map(acted).collect(),
            named: conclusion.effects.iter().map(group).collect(),
            status: conclusion.status,
            flagged: conclusion.suspect.is_some(),
        }
    }
}
