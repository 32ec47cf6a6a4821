//! Calibration of the whole loop: constants, load, thickness, noise and effects are drawn from their priors, a field is simulated with all of
//! them on a finer mesh, the loop is closed on it, and the truth is looked for among the draws that it quotes. With `withheld` the
//! dictionary lacks what acts most.

use std::collections::BTreeMap;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::calibration::{NOISE_NM, Parameter, Plan, Replicate, model_of, of_draws, summarise};
use super::record::Record;
use crate::diagnose::Rule;
use crate::effect::{Acting, Effect, LOAD_SCALE, amplitude_name};
use crate::error::{Error, Result};
use crate::experiment::simulate::Truth;
use crate::field::matrices::write_matrices;
use crate::field::{READERS, Source};
use crate::identify::Options;
use crate::infer::Model;
use crate::progress::{Progress, Silent};
use crate::sample::{SAMPLERS, Schedule};
use crate::trace::{SIZES, candidates, close, quote, quoted_rule};

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

/// Rounds after which a loop ends.
const ROUNDS: usize = 5;
/// A replicate whose effects cannot act together is drawn anew, so often.
const ATTEMPTS: u64 = 20;

/// Run or go on with a record at `path`, and return all replicates.
///
/// # Errors
/// A record of another plan; what simulation and the loop may fail with.
pub fn calibrate_loop(
    model: &Model,
    plan: &Plan,
    withheld: bool,
    cache: &Path,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Vec<LoopReplicate>> {
    let model = model_of(model);
    // a longer or shorter record of the same plan is the same record
    let of = Plan {
        replicates: 0,
        ..plan.clone()
    };
    let of = (of, withheld, &model.file);
    let (mut record, mut done) = Record::open_among::<LoopReplicate>(path, &of, plan.share)?;
    let todo = plan.todo(|k| done.iter().any(|r| r.ranked.replicate == k));
    progress.begin("calibration of the loop", Some(todo.len() as u64));
    for some in todo.chunks(rayon::current_num_threads()) {
        let found: Vec<Result<LoopReplicate>> = some
            .par_iter()
            .map(|&k| {
                let found = replicate(&model, plan, withheld, k, cache, path);
                progress.step();
                found
            })
            .collect();
        for found in found {
            let found = found?;
            record.add(&found)?;
            done.push(found);
        }
    }
    progress.end();
    done.retain(|r| r.ranked.replicate < plan.replicates);
    done.sort_by_key(|r| r.ranked.replicate);
    done.dedup_by_key(|r| r.ranked.replicate);
    Ok(done)
}

/// What is drawn of a replicate.
struct Drawn {
    truth: Truth,
    acted: Vec<&'static dyn Effect>,
}

/// A draw from the priors, by the seed of the replicate and of the attempt; with an effect at least if one is to be `withheld`.
fn draw(model: &Model, plan: &Plan, withheld: bool, replicate: usize, attempt: u64) -> Drawn {
    let mut rng = Pcg64Dxsm::seed_from_u64(plan.seed_of(replicate, 4 + attempt));
    let marginals = model.marginals();
    let constants = loop {
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let x: Vec<f64> = marginals.iter().map(|m| m.mean + m.sd * normal()).collect();
        let inside = marginals.iter().zip(&x).all(|(m, x)| {
            let [low, high] = m.bounds();
            (low..=high).contains(x)
        });
        if inside && model.material().ply(&x).is_admissible() {
            break x;
        }
    };
    let (mut open, _) = candidates(model);
    let mut left: f64 = rng.random();
    let number = SIZES.iter().take_while(|p| {
        left -= *p;
        left > 0.0
    });
    let mut acted = Vec::new();
    let number = number.count().max(usize::from(withheld)).min(open.len());
    for _ in 0..number {
        acted.push(open.swap_remove(rng.random_range(0..open.len())));
    }
    let mut acting = |effect: &'static dyn Effect| Acting {
        effect,
        amplitude: (effect.parameters().iter())
            .map(|p| {
                let z: f64 = StandardNormal.sample(&mut rng);
                let z = if p.positive { z.abs() } else { z };
                (p.prior_sd.unwrap_or(0.0) * z).clamp(-p.bound, p.bound)
            })
            .collect(),
    };
    let mut effects: Vec<Acting> = acted.iter().map(|e| acting(*e)).collect();
    effects.push(acting(LOAD_SCALE));
    // the load scale has its own draw above
    let thickness = model.experiment().specimen.thickness_mm;
    let z: f64 = StandardNormal.sample(&mut rng);
    let [low, high] = NOISE_NM;
    let truth = Truth {
        constants,
        thickness_mm: thickness.mean + thickness.sd * z,
        effects,
        noise_nm: low * (high / low).powf(rng.random()),
        correlation_mm: plan.correlation_mm,
        grid: plan.grid,
        seed: rng.random(),
    };
    Drawn { truth, acted }
}

/// Simulate, close the loop, and look for the truth.
fn replicate(
    model: &Model,
    plan: &Plan,
    withheld: bool,
    replicate: usize,
    cache: &Path,
    record: &Path,
) -> Result<LoopReplicate> {
    let mut last = None;
    for attempt in 0..ATTEMPTS {
        let drawn = draw(model, plan, withheld, replicate, attempt);
        match model.simulate(&drawn.truth) {
            Err(e) => last = Some(e),
            Ok(grid) => {
                // each thread has a place of its own for the field
                let place = record.with_extension(format!("field-{replicate}"));
                write_matrices(&place, &grid, None)?;
                let found = closed(model, plan, withheld, replicate, &drawn, &place, cache);
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
    plan: &Plan,
    withheld: bool,
    replicate: usize,
    drawn: &Drawn,
    place: &Path,
    cache: &Path,
) -> Result<LoopReplicate> {
    let mut model = model.clone();
    model.experiment_mut().measurement.source = Source {
        reader: READERS[0],
        path: Some(std::path::absolute(place).unwrap_or_else(|_| place.to_path_buf())),
        columns: None,
    };
    if withheld {
        let (all, _) = candidates(&model);
        let lacks = drawn.acted.first().map_or("", |e| e.name());
        let names = all.iter().map(|e| e.name()).filter(|n| *n != lacks);
        model.experiment_mut().candidates = Some(names.map(String::from).collect());
    }
    let sampler = (SAMPLERS[0].build)();
    let options = |k: usize| Options {
        sampler: &*sampler,
        schedule: Schedule {
            seed: plan.seed_of(replicate, 100 + k as u64),
            ..Schedule::default()
        },
        rule: quoted_rule(&Rule::default()),
        cache: cache.to_path_buf(),
        refinements: 0,
        keeping: None,
        discrepancy: [None, None],
        deadline: None,
    };
    let mut found = close(&model, ROUNDS, &options, &Silent)?;
    let flagged = found.conclusion.suspect.is_some();
    found.sampled = Some(quote(&found.rounds, flagged, &options(99), &Silent)?);
    let intervals = found.quoted();
    let constants = model.constants();
    let held = constants
        .iter()
        .zip(&drawn.truth.constants)
        .map(|(name, x)| {
            let interval = &intervals[*name];
            (interval.low..=interval.high).contains(x)
        });
    let held = held.collect();
    let known = truths(&model, drawn);
    let Some(sampled) = &found.sampled else {
        return Err(Error::program("calibration", "quoted draws"));
    };
    let (names, ranked) = of_draws(&sampled.draws, &known, replicate);
    let named = found.rounds.iter().filter_map(|r| r.tracing.accepted);
    Ok(LoopReplicate {
        names,
        ranked,
        held,
        acted: drawn.acted.iter().map(|e| e.name().to_string()).collect(),
        named: named.map(|e| e.name().to_string()).collect(),
        status: found.conclusion.status.words().to_string(),
        flagged,
    })
}

/// What is true, by the names of the quoted draws: the constants first.
fn truths(model: &Model, drawn: &Drawn) -> Vec<(String, f64)> {
    let constants = model.constants().iter().map(|n| (*n).to_string());
    let mut known: Vec<(String, f64)> = constants
        .zip(drawn.truth.constants.iter().copied())
        .collect();
    for acting in &drawn.truth.effects {
        for (p, x) in acting.effect.parameters().iter().zip(&acting.amplitude) {
            known.push((amplitude_name(acting.effect, p), *x));
        }
    }
    known
}

/// How the loop fared.
pub struct LoopSummary {
    pub plan: Plan,
    pub withheld: bool,
    pub replicates: usize,
    /// Constants, and amplitudes of effects, each over the replicates that quote it.
    pub constants: Vec<Parameter>,
    pub amplitudes: Vec<Parameter>,
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
    pub fn new(plan: &Plan, withheld: bool, all: &[LoopReplicate]) -> Self {
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

#[cfg(test)]
#[path = "../../tests/unit/whole_loop.rs"]
mod tests;
