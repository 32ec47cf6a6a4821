//! Calibration of the whole loop: constants, load, thickness, noise and effects are drawn from their priors, a field or a load series is
//! simulated with all of them on a finer mesh, the loop is closed on it, and the truth is looked for among the draws that it quotes. With
//! `withheld` the dictionary lacks what acts most.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::calibration::{ParameterRanks, Replicate, model_of, of_draws, summarise};
use super::drawn::{Acts, Drawn, noise_nm};
use super::replicates::{Numbered, ReplicatePlan, replicates};
use crate::diagnose::Rule;
use crate::error::{Error, Result};
use crate::files::Keyed;
use crate::identify::Options;
use crate::infer::Model;
use crate::linearise::candidates;
use crate::progress::{Progress, Silent};
use crate::sample::{SAMPLERS, Sampler, Schedule};
use crate::trace::{Interval, LoopStage, ToQuote, close, quoted_rule};

/// One line of the record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LoopReplicate {
    /// Constants, and whatever else was drawn that the quoted draws know, by name.
    pub names: Vec<String>,
    pub ranked: Replicate,
    /// Whether the quoted 95 % interval of each constant holds it.
    pub held: Vec<bool>,
    /// What acted, and what the loop named.
    pub acted: Vec<String>,
    pub named: Vec<String>,
    pub status: String,
    /// Whether the account was flagged, and what spans several answers quoted.
    pub flagged: bool,
}

/// What is said while replicates of a loop are done.
pub(super) const OF_THE_LOOP: &str = "calibration of the loop";

/// Rounds after which a loop ends.
pub(super) const ROUNDS: usize = 5;
/// A replicate whose effects cannot act together is drawn anew, so often.
const ATTEMPTS: u64 = 20;

/// Run or go on with a record at `path`, and return all replicates.
///
/// # Errors
/// A record of another plan; what simulation and the loop may fail with.
pub fn calibrate_loop(
    model: &Model,
    plan: &ReplicatePlan,
    withheld: bool,
    cache: &Path,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Vec<LoopReplicate>> {
    let model = &model_of(model);
    refuse_unknown_forces(model)?;
    let one = |k: usize| {
        let acts = if withheld {
            Acts::AtLeastOne
        } else {
            Acts::Expected
        };
        let found = |model: &Model, drawn: &Drawn| closed(model, plan, withheld, k, drawn, cache);
        measured(model, plan, (acts, k), path, &found)
    };
    let of = (path, &(withheld, &model.file));
    replicates(of, plan, (OF_THE_LOOP, &one), progress)
}

impl Numbered for LoopReplicate {
    fn replicate(&self) -> usize {
        self.ranked.replicate
    }
}

/// Forces cannot be drawn about values that nobody declares.
pub(super) fn refuse_unknown_forces(model: &Model) -> Result<()> {
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

/// Simulate a replicate, and what is `found` in its measurement.
pub(super) fn measured<T>(
    model: &Model,
    plan: &ReplicatePlan,
    (acts, replicate): (Acts, usize),
    record: &Path,
    found: &dyn Fn(&Model, &Drawn) -> Result<T>,
) -> Result<T> {
    let mut last = None;
    for attempt in 0..ATTEMPTS {
        let drawn = Drawn::new(model, plan, acts, replicate, attempt);
        // each thread has a place of its own for the measurement
        let place = record.with_extension(format!("field-{replicate}"));
        match drawn.simulated(model, &place) {
            Err(e) => last = Some(e),
            Ok(measured) => {
                let found = found(&measured, &drawn);
                // a field that cannot be removed does no harm
                let _ = std::fs::remove_dir_all(&place);
                return found.map_err(|e| e.within(format!("replicate {replicate}")));
            }
        }
    }
    let none = || Error::program("calibration", "effects that can act together");
    Err(last
        .unwrap_or_else(none)
        .within(format!("replicate {replicate}")))
}

fn closed(
    model: &Model,
    plan: &ReplicatePlan,
    withheld: bool,
    replicate: usize,
    drawn: &Drawn,
    cache: &Path,
) -> Result<LoopReplicate> {
    let mut model = model.clone();
    if withheld {
        let (all, _) = candidates(&model);
        let lacks = drawn.acted.first().map_or("", |a| a.effect.name());
        let names = all.iter().map(|e| e.name()).filter(|n| *n != lacks);
        model.experiment_mut().candidates = Some(names.map(String::from).collect());
    }
    let sampler = (SAMPLERS[0].build)();
    let options = |stage: LoopStage| options(&*sampler, plan, (replicate, stage), cache);
    let found = close(&model, ROUNDS, &options, &Silent)?;
    let held = held(&model, drawn, &found.quoted());
    let known = drawn.truths(&model);
    let sampled = match found.to_quote {
        ToQuote::Sampled(sampled) => sampled,
        ToQuote::ClosedForm(why) => return Err(why),
    };
    let (names, ranked) = of_draws(&sampled.draws, &known, replicate);
    let named = found
        .rounds
        .iter()
        .filter_map(|r| r.tracing.accepted.as_ref());
    Ok(LoopReplicate {
        names,
        ranked,
        held,
        acted: (drawn.acted.iter())
            .map(|a| a.effect.name().to_string())
            .collect(),
        named: named.map(|a| a.effect.name().to_string()).collect(),
        status: found.conclusion.status.words().to_string(),
        flagged: found.conclusion.suspect.is_some(),
    })
}

/// Whether each interval holds the true constant.
pub(super) fn held(model: &Model, drawn: &Drawn, quoted: &Keyed<Interval>) -> Vec<bool> {
    let constants = model.constants().iter().zip(drawn.constants());
    let is_held = |(name, x): (&&str, &f64)| (quoted[*name].low..=quoted[*name].high).contains(x);
    constants.map(is_held).collect()
}

/// How a stage of a replicate's loop is run.
pub(super) fn options<'a>(
    sampler: &'a dyn Sampler,
    plan: &ReplicatePlan,
    (replicate, stage): (usize, LoopStage),
    cache: &Path,
) -> Options<'a> {
    let stream = match stage {
        LoopStage::Attempt(attempt) => 100 + attempt as u64,
        LoopStage::Answer(_) => 199,
    };
    Options {
        schedule: Schedule {
            seed: plan.seed_of(replicate, stream),
            ..Schedule::default()
        },
        rule: quoted_rule(&Rule::default()),
        ..Options::new(sampler, cache)
    }
}

/// How the loop fared.
pub struct LoopSummary {
    pub plan: ReplicatePlan,
    /// Between which the noise of a point was drawn, nm.
    pub noise_nm: [f64; 2],
    /// Steps of the load series, 0 of a single field.
    pub steps: usize,
    pub withheld: bool,
    pub replicates: usize,
    /// Constants, and amplitudes of effects, each over the replicates that quote it.
    pub constants: Vec<ParameterRanks>,
    pub amplitudes: Vec<ParameterRanks>,
    /// Quoted 95 % intervals that hold their constant, of all.
    pub held: [usize; 2],
    /// Replicates flagged, and those that name what did not act.
    pub flagged: usize,
    pub wrong: usize,
    /// Effects that acted, and those of them that were named.
    pub acted: [usize; 2],
    pub statuses: BTreeMap<String, usize>,
}

impl LoopSummary {
    pub fn new(model: &Model, plan: &ReplicatePlan, withheld: bool, all: &[LoopReplicate]) -> Self {
        let mut of: BTreeMap<(bool, String), Vec<Replicate>> = BTreeMap::new();
        for r in all {
            for (k, name) in r.names.iter().enumerate() {
                let key = (k >= r.held.len(), name.clone());
                of.entry(key).or_default().push(r.ranked.only(k));
            }
        }
        let mut parameters = [Vec::new(), Vec::new()];
        for ((is_amplitude, name), own) in &of {
            let summary = summarise(plan, std::slice::from_ref(name), own);
            parameters[usize::from(*is_amplitude)].extend(summary.parameters);
        }
        let [constants, amplitudes] = parameters;
        let held = || all.iter().flat_map(|r| &r.held);
        let names_other = |r: &&LoopReplicate| r.named.iter().any(|n| !r.acted.contains(n));
        let named = |r: &LoopReplicate| r.acted.iter().filter(|a| r.named.contains(a)).count();
        let mut statuses = BTreeMap::new();
        for r in all {
            *statuses.entry(r.status.clone()).or_default() += 1;
        }
        Self {
            plan: plan.clone(),
            noise_nm: noise_nm(model),
            steps: model.experiment().steps.as_ref().map_or(0, Vec::len),
            withheld,
            replicates: all.len(),
            constants,
            amplitudes,
            held: [held().filter(|h| **h).count(), held().count()],
            flagged: all.iter().filter(|r| r.flagged).count(),
            wrong: all.iter().filter(names_other).count(),
            acted: [
                all.iter().map(|r| r.acted.len()).sum(),
                all.iter().map(named).sum(),
            ],
            statuses,
        }
    }
}
