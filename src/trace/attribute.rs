//! Tracing: which effects of the dictionary the data ask for beyond a fitted model, what could stand in for them, and what
//! the data could not have shown.

use std::sync::Arc;

use super::account::{About, Account};
use super::alias::groups;
use super::evidence::{Evidence, evidence};
use super::insoluble::without_insoluble;
use super::recording;
use super::ridge::{CONVERGED, STEPS, at_ridge};
use super::sensitivities::{Few, Linearised, Measured};
use super::series::attribute_series;
use super::sought::candidates;
use super::tracing::Tracing;
use super::weighing::Weighing;
use crate::effect::{Effect, Kind};
use crate::error::Result;
use crate::experiment::State;
use crate::field::Field;
use crate::identify::{Prepared, is_clear};
use crate::infer::{Model, divide};
use crate::progress::Progress;

/// Passes of linearisation, each with the strongest effect at its estimate: linearising at several new effects at once oscillated on a
/// large offset of the hole (prototype study).
const PASSES: usize = 4;

/// Trace what a fitted model leaves unexplained, from the constants and declared amplitudes of `start`, to the effects that are
/// `wanted` by name; with the account that this rests on.
///
/// # Errors
/// Those of finite-element solutions; too few blocks for the dictionary.
pub fn attribute(
    model: &Model,
    prepared: &Prepared,
    start: State,
    wanted: &dyn Fn(&str) -> bool,
    progress: &dyn Progress,
) -> Result<(Tracing, Account)> {
    if let Some(steps) = &prepared.observation.steps {
        return attribute_series(model, prepared, steps, start, wanted, progress);
    }
    let (mut effects, left_out) = candidates(model);
    effects.retain(|e| wanted(e.name()));
    let field = &prepared.observation.field;
    without_insoluble(
        effects,
        &|e| e.name(),
        &|effects| {
            let measured = measured(prepared, field);
            linearised(model, prepared, &measured, &|| ()).insoluble(&start, effects)
        },
        &|effects, insoluble| {
            let (mut tracing, account) =
                attribute_field(model, prepared, start.clone(), effects, progress)?;
            tracing.left_out = left_out.iter().cloned().chain(insoluble).collect();
            Ok((tracing, account))
        },
    )
}

fn attribute_field(
    model: &Model,
    prepared: &Prepared,
    start: State,
    effects: Vec<&'static dyn Effect>,
    progress: &dyn Progress,
) -> Result<(Tracing, Account)> {
    let own = &prepared.observation.field;
    progress.begin("the field at the constants found", None);
    let (corrected, mut jumps) =
        recording::find_jumps(model, own, &prepared.predict(&start)?.field)?;
    progress.end();
    let trace = |field: &Field| trace_field(model, prepared, field, &start, &effects, progress);
    let mut traced = None;
    if jumps.is_some() {
        // what an effect leaves may be as steep as a smeared jump: a jump is still there once the strongest effect acts
        let plain = trace(own)?;
        if !recording::may_jump(model, own, &prepared.predict(&plain.state)?.field) {
            jumps = None;
            traced = Some(plain);
        }
    }
    let field = corrected.as_ref().filter(|_| jumps.is_some());
    let field = field.unwrap_or(own);
    let Traced {
        state,
        size_mm,
        evidence,
    } = traced.map_or_else(|| trace(field), Ok)?;
    progress.begin("tracing: held-out blocks, blind spots", None);
    let mut tracing = evidence.tracing(&state.constants)?;
    let phase = recording::find_phase(model, field, &prepared.predict(&state)?.field)?;
    tracing.add_recorded(jumps, phase);
    progress.end();
    let about = About::Field {
        state,
        sought: effects,
        size_mm,
    };
    Ok((tracing, Account { evidence, about }))
}

/// A field with what was weighed of it, and the state about which it was.
struct Traced {
    state: State,
    size_mm: f64,
    evidence: Evidence,
}

fn measured(prepared: &Prepared, field: &Field) -> Measured {
    let geometry = &*prepared.problem.experiment.scene().setup.geometry;
    Measured::new(field, |i| is_clear(geometry, field.points[i]))
}

/// Root mean square of the displacements, mm.
fn size_mm(field: &Field) -> f64 {
    let square: f64 = field.displacement.iter().flatten().map(|u| u * u).sum();
    (square / field.len().max(1) as f64).sqrt()
}

/// A prepared model to be linearised over a field's blocks.
fn linearised<'a>(
    model: &'a Model,
    prepared: &'a Prepared,
    measured: &'a Measured,
    step: &'a (dyn Fn() + Sync),
) -> Linearised<'a> {
    Linearised {
        model,
        experiment: &*prepared.problem.experiment,
        size_mm: size_mm(&prepared.observation.field),
        few: Few::new(prepared, &measured.blocks),
        step,
    }
}

fn trace_field(
    model: &Model,
    prepared: &Prepared,
    field: &Field,
    start: &State,
    effects: &[&'static dyn Effect],
    progress: &dyn Progress,
) -> Result<Traced> {
    let measured = Arc::new(measured(prepared, field));
    let step = || progress.step();
    let linearised = Linearised {
        size_mm: size_mm(field),
        ..linearised(model, prepared, &measured, &step)
    };
    let mut state = start.clone();
    let evidence = converged(&linearised, &measured, &mut state, effects, progress)?;
    Ok(Traced {
        state,
        size_mm: linearised.size_mm,
        evidence,
    })
}

/// Linearise and weigh, with the strongest effect of the best subset in the state, until that effect and its amplitudes repeat.
fn converged(
    linearised: &Linearised<'_>,
    measured: &Arc<Measured>,
    state: &mut State,
    effects: &[&'static dyn Effect],
    progress: &dyn Progress,
) -> Result<Evidence> {
    let mut leader: Option<usize> = None;
    let mut pass = 0;
    loop {
        pass += 1;
        let [own, sought] = linearised.columns(effects);
        let most = (1 + STEPS) * own + sought;
        let count = effects.len();
        let what = format!("tracing, pass {pass}: sensitivities to {count} effects");
        progress.begin(&what, Some(most as u64));
        let sensitivities = at_ridge(linearised, measured, state, effects)?;
        progress.end();
        let what = format!("tracing, pass {pass}: effects against noise");
        progress.begin(&what, Some(Weighing::steps() as u64));
        let found = evidence(sensitivities, measured, &|| progress.step())?;
        let strongest = groups(&found.subsets).first().map(|g| g.leader);
        progress.say(strongest.map_or("no effect", |k| effects[k].name()));
        progress.end();
        let Some(k) = strongest.filter(|_| pass < PASSES) else {
            return Ok(found);
        };
        let moved = adopt(state, &found, k, leader);
        leader = Some(k);
        if moved < CONVERGED {
            return Ok(found);
        }
    }
}

/// Take the best subset's amplitudes of its strongest effect into the state; how far they move, in prior sds. The effect
/// taken in before, if it is another one now, leaves the state.
fn adopt(state: &mut State, evidence: &Evidence, leader: usize, before: Option<usize>) -> f64 {
    let (sensitivities, subsets) = (&evidence.sensitivities, &evidence.subsets);
    if let Some(old) = before.filter(|old| *old != leader) {
        let effect = sensitivities.candidates[old].effect;
        state.set(effect, vec![0.0; effect.parameters().len()]);
    }
    let best = subsets.best();
    let (mean, _) = subsets.amplitudes(best);
    let at = best
        .iter()
        .take_while(|k| **k != leader)
        .map(|&k| subsets.layout.ranges[k].len())
        .sum::<usize>();
    let candidate = &sensitivities.candidates[leader];
    let columns = &candidate.columns[..candidate.effect.parameters().len()];
    let wanted = columns.iter().enumerate();
    let mut wanted: Vec<f64> = wanted
        .map(|(j, column)| column.mean + column.sd * mean[at + j])
        .collect();
    divide(columns, &mut wanted);
    let mut moved = 0.0_f64;
    let amplitude = columns
        .iter()
        .zip(candidate.effect.parameters())
        .zip(wanted)
        .map(|((column, parameter), wanted)| {
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
