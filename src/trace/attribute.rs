//! Tracing: which effects of the dictionary the data ask for beyond a fitted model, what could stand in for them, and what
//! the data could not have shown.

use std::borrow::Cow;

use super::alias::groups;
use super::averaged::{Averaged, BlindSpot};
use super::evidence::Evidence;
use super::recording;
use super::sensitivities::{Linearised, Sensitivities};
use super::subsets::Subsets;
use super::weighing::Weighing;
use crate::effect::{EFFECTS, Effect, Kind, LOAD_SCALE};
use crate::error::Result;
use crate::experiment::{State, predict};
use crate::field::Blocks;
use crate::identify::{Prepared, is_clear};
use crate::infer::Model;
use crate::noise::Hyperparameters;
use crate::progress::Progress;

/// An effect weighed against the data.
#[derive(Clone)]
pub struct Found {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Posterior probability that it acts.
    pub inclusion_probability: f64,
    /// Log Bayes factor for its acting.
    pub log_bayes_factor: f64,
    /// Mean and sd of each amplitude if it acts, border units.
    pub amplitude: Vec<(String, f64, f64)>,
    /// Largest amplitude over its plausible size.
    pub multiple: f64,
    /// Share of the structured part of chi^2 that it explains alone.
    pub explained_fraction: f64,
    /// Smallest amplitude of its first parameter that would have been found, border units.
    pub detectable: f64,
    /// Effects of its alias group, or else those of the most similar signatures, with the cosine.
    pub aliases: Vec<(&'static str, f64)>,
}

/// What tracing found.
pub struct Tracing {
    /// All candidates, the most probable first.
    pub candidates: Vec<Found>,
    /// Alias groups of the best subset, by name, the strongest first, with probability, log evidence lost when it is dropped,
    /// and whether held-out blocks are predicted better with it.
    pub groups: Vec<Named>,
    /// The effect to add, if one is called for.
    pub accepted: Option<&'static dyn Effect>,
    /// Its amplitudes (mean, sd) a parameter, border units.
    pub accepted_amplitude: Vec<(f64, f64)>,
    /// Groups that the data speak for without being sure.
    pub undecided: Vec<Vec<&'static str>>,
    /// Probability of smooth structure that no effect explains.
    pub discrepancy: f64,
    /// Correlation length (mm) of the likeliest noise or discrepancy of each component.
    pub length_mm: [f64; 2],
    /// The likeliest setting of each component, where it is a discrepancy.
    pub structure: [Option<Hyperparameters>; 2],
    /// The constants, averaged over what may act unseen.
    pub averaged: Vec<Averaged>,
    /// What could hide in the residual.
    pub blind_spots: Vec<(&'static str, BlindSpot)>,
    /// RMS error of held-out block averages by the model as it is, nm.
    pub holdout_rms_nm: f64,
    /// Effects left out, with the reason.
    pub left_out: Vec<(&'static str, String)>,
}

/// Above this probability the structure left is called unexplained.
const UNEXPLAINED: f64 = 0.5;

impl Tracing {
    /// Whether smooth structure is left that no effect explains.
    pub fn leaves_structure(&self) -> bool {
        self.discrepancy > UNEXPLAINED
    }
}

/// An alias group by names.
#[derive(Debug, Clone)]
pub struct Named {
    /// The member with the largest evidence.
    pub leader: &'static str,
    /// All single members.
    pub members: Vec<&'static str>,
    /// Pairs that together could stand in.
    pub pairs: Vec<[&'static str; 2]>,
    /// Probability that some member acts.
    pub probability: f64,
    /// Log evidence lost when it is dropped.
    pub drop_nats: f64,
    /// Whether held-out blocks are predicted better with it.
    pub predicts: bool,
    /// Effects outside the group that leave almost the same field.
    pub resembling: Vec<Resembling>,
}

/// An effect that leaves almost the same field as the leader of a group does: only the finer shape of the field, or the
/// size that it would need, speak against it.
#[derive(Debug, Clone)]
pub struct Resembling {
    /// Its name.
    pub effect: &'static str,
    /// Cosine of the leader's part of the field and the nearest field of this effect.
    pub cosine: f64,
    /// The amplitudes that it would need, border units.
    pub amplitude: Vec<(String, f64)>,
    /// The largest of them over its plausible size.
    pub multiple: f64,
    /// Log evidence lost with it in the leader's place.
    pub lost_nats: f64,
}

/// Passes of linearisation about the best effect.
const PASSES: usize = 4;

/// Amplitudes that move by less, prior sds, are settled.
const SETTLED: f64 = 0.05;

/// Effects that may be weighed in a model, and those that may not, with the reason.
pub fn candidates(model: &Model) -> (Vec<&'static dyn Effect>, Vec<(&'static str, String)>) {
    let scene = model.scene();
    let mut chosen = Vec::new();
    let mut left_out = Vec::new();
    for effect in EFFECTS {
        let name = effect.name();
        if model.effects.iter().any(|e| e.name() == name) {
            continue;
        }
        let listed = model
            .experiment()
            .candidates
            .as_ref()
            .is_none_or(|list| list.iter().any(|n| n == name));
        if !listed {
            left_out.push((name, "not among the model's candidates".to_string()));
        } else if let Some(reason) = effect.obstacle(&scene) {
            left_out.push((name, reason.to_string()));
        } else if name == LOAD_SCALE.name() {
            left_out.push((
                name,
                "a scale of the load cannot be told from a common factor of all moduli".to_string(),
            ));
        } else if effect.kind() != Kind::Recorded {
            chosen.push(*effect);
        }
    }
    (chosen, left_out)
}

/// Trace what a fitted model leaves unexplained, from the constants and declared amplitudes of `start`.
///
/// # Errors
/// Those of finite-element solutions; too few blocks for the dictionary.
pub fn attribute(
    model: &Model,
    prepared: &Prepared,
    start: State,
    progress: &dyn Progress,
) -> Result<Tracing> {
    let (effects, left_out) = candidates(model);
    let mut tested_field = Cow::Borrowed(&prepared.observation.field);
    let sight = &prepared.observation.sight;
    let view = |state: &State| predict(&*prepared.problem.experiment, state, sight);
    progress.begin("the field at the constants found", None);
    let (corrected, jumps) = recording::find_jumps(model, &tested_field, &view(&start)?.field)?;
    progress.end();
    if let Some(corrected) = corrected {
        tested_field = Cow::Owned(corrected);
    }
    let field = &*tested_field;
    let geometry = &*prepared.problem.experiment.scene().setup.geometry;
    let beyond = |i: usize| is_clear(geometry, field.points[i]);
    let blocks = Blocks::new(field, Blocks::size_for(field), beyond);
    let linearised = Linearised {
        model,
        prepared,
        measured: &field.displacement,
        blocks: &blocks,
        step: &|| progress.step(),
    };
    let mut state = start;
    let mut leader: Option<usize> = None;
    let mut pass = 0;
    let (sensitivities, weighing, subsets) = loop {
        pass += 1;
        let [own, sought] = linearised.columns(&effects);
        let most = (1 + STEPS) * own + sought;
        progress.begin(
            &format!(
                "tracing, pass {pass}: signatures of {} effects",
                effects.len()
            ),
            Some(most as u64),
        );
        let sensitivities = settle(&linearised, &mut state, &effects)?;
        progress.end();
        progress.begin(
            &format!("tracing, pass {pass}: effects against noise"),
            Some(Weighing::steps() as u64),
        );
        let weighing = Weighing::new(&blocks, &sensitivities, &|| progress.step())?;
        let counts: Vec<usize> = sensitivities
            .candidates
            .iter()
            .map(|c| c.columns.len())
            .collect();
        let subsets = Subsets::new(&weighing, &counts)?;
        let strongest = groups(&subsets).first().map(|g| g.leader);
        progress.say(strongest.map_or("no effect", |k| effects[k].name()));
        progress.end();
        let Some(k) = strongest.filter(|_| pass < PASSES) else {
            break (sensitivities, weighing, subsets);
        };
        let moved = adopt(&mut state, &sensitivities, &subsets, k, leader);
        leader = Some(k);
        if moved < SETTLED {
            break (sensitivities, weighing, subsets);
        }
    };
    progress.begin("tracing: held-out blocks, blind spots", None);
    let evidence = Evidence {
        blocks: &blocks,
        sensitivities: &sensitivities,
        weighing: &weighing,
        subsets: &subsets,
    };
    let mut tracing = evidence.tracing(&state)?;
    tracing.left_out = left_out;
    let phase = recording::find_phase(model, field, &view(&state)?.field)?;
    tracing.add_recorded(jumps, phase);
    progress.end();
    Ok(tracing)
}

impl Tracing {
    /// Put the effects of the recording, which are sought by their own ways, among the candidates: miscounted orders are
    /// accepted before anything else, a phase-shift error if nothing else has more evidence.
    fn add_recorded(&mut self, jumps: Option<Found>, phase: Option<(Found, bool)>) {
        let strongest = self
            .accepted
            .and_then(|e| self.groups.iter().find(|g| g.leader == e.name()))
            .map_or(f64::NEG_INFINITY, |g| g.drop_nats);
        let mut accept = None;
        if let Some((found, clear)) = phase {
            if clear && found.log_bayes_factor > strongest {
                accept = Some(found.clone());
            }
            if clear {
                self.groups.push(Named::alone(&found));
            }
            self.candidates.push(found);
        }
        if let Some(found) = jumps {
            accept = Some(found.clone());
            self.groups.push(Named::alone(&found));
            self.candidates.push(found);
        }
        if let Some(found) = accept {
            self.accepted = Some(found.effect);
            self.accepted_amplitude = found.amplitude.iter().map(|(_, m, s)| (*m, *s)).collect();
        }
        self.candidates.sort_by(|a, b| {
            b.inclusion_probability
                .total_cmp(&a.inclusion_probability)
                .then_with(|| b.log_bayes_factor.total_cmp(&a.log_bayes_factor))
        });
    }
}

impl Named {
    /// The group of an effect that nothing else in the dictionary resembles.
    fn alone(found: &Found) -> Self {
        Self {
            leader: found.effect.name(),
            members: vec![found.effect.name()],
            pairs: Vec::new(),
            probability: found.inclusion_probability,
            drop_nats: found.log_bayes_factor,
            predicts: true,
            resembling: Vec::new(),
        }
    }
}

/// Take the best subset's amplitudes of its strongest effect into the state; how far they move, in prior sds. The effect
/// taken in before, if it is another one now, leaves the state.
fn adopt(
    state: &mut State,
    sensitivities: &Sensitivities,
    subsets: &Subsets,
    leader: usize,
    before: Option<usize>,
) -> f64 {
    if let Some(old) = before.filter(|old| *old != leader) {
        let effect = sensitivities.candidates[old].effect;
        state.set(effect, vec![0.0; effect.parameters().len()]);
    }
    let best = subsets.best();
    let (mean, _) = subsets.amplitudes(best);
    let at = best
        .iter()
        .take_while(|k| **k != leader)
        .map(|&k| subsets.ranges[k].len())
        .sum::<usize>();
    let candidate = &sensitivities.candidates[leader];
    let mut moved = 0.0_f64;
    let amplitude = candidate
        .columns
        .iter()
        .zip(candidate.effect.parameters())
        .enumerate()
        .map(|(j, (column, parameter))| {
            let wanted = column.mean + column.sd * mean[at + j];
            let kept = wanted.clamp(-0.9 * parameter.bound, 0.9 * parameter.bound);
            moved = moved.max((kept - column.at).abs() / column.sd);
            kept
        })
        .collect();
    state.set(candidate.effect, amplitude);
    if candidate.effect.kind() == Kind::Additive {
        // linear: the sensitivities do not depend on the amplitude
        return 0.0;
    }
    moved
}

/// Steps of the Gauss-Newton iteration.
const STEPS: usize = 4;

/// Move the constants and declared amplitudes to where the data want them with every effect present at its plausible size: a fit without
/// the effects runs to absurd constants when a quiet one acts. Returns the sensitivities there.
fn settle(
    linearised: &Linearised<'_>,
    state: &mut State,
    effects: &[&'static dyn Effect],
) -> Result<Sensitivities> {
    let mut sensitivities = linearised.sensitivities(state, effects)?;
    for _ in 0..STEPS {
        let moved = ridge_step(linearised, state, &sensitivities);
        if moved < SETTLED {
            break;
        }
        sensitivities = linearised.again(state, &sensitivities)?;
    }
    Ok(sensitivities)
}

/// One step to the ridge estimate under noise that is white on blocks; how far it goes, in prior sds.
fn ridge_step(
    linearised: &Linearised<'_>,
    state: &mut State,
    sensitivities: &Sensitivities,
) -> f64 {
    let solution = sensitivities.ridge(&linearised.blocks.count);
    let mut moved = 0.0_f64;
    for (k, value) in state.constants.iter_mut().enumerate() {
        let column = &sensitivities.base[k];
        // a prior sd a step keeps the constants admissible and the linearisation valid
        let wanted = column.mean + column.sd * solution[k];
        let step = (wanted - *value).clamp(-column.sd, column.sd);
        *value += step;
        moved = moved.max(step.abs() / column.sd);
    }
    for effect in &linearised.model.effects {
        let mut amplitude = state.amplitude(*effect);
        for (value, parameter) in amplitude.iter_mut().zip(effect.parameters()) {
            let name = crate::effect::amplitude_name(*effect, parameter);
            let Some(k) = sensitivities.base.iter().position(|c| c.name == name) else {
                continue;
            };
            let column = &sensitivities.base[k];
            let wanted = column.mean + column.sd * solution[k];
            if effect.kind() != Kind::Additive {
                moved = moved.max((wanted - *value).abs() / column.sd);
            }
            *value = wanted.clamp(-0.9 * parameter.bound, 0.9 * parameter.bound);
        }
        state.set(*effect, amplitude);
    }
    moved
}
