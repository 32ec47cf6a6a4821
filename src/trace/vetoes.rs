//! What forbids a verdict of `closed` or `nothing_missing`, one function a condition. Each says in words what it objects to.

use super::evidence::LARGEST_MULTIPLE;
use super::patches::{PatchPart, largest_part};
use super::round::Round;
use super::together::tension;
use crate::effect::{Effect, Kind, amplitude_name};
use crate::identify::Identification;
use crate::infer::Model;
use crate::quantity::{chance, plus_minus};

/// What acts lies so many sds from zero.
const ACTS_SDS: f64 = 2.0;

/// A step is predicted by all others within so many sds of its misfit (prototype study).
const STEP_SDS: f64 = 4.5;

/// All objections to the last round of a loop.
pub fn vetoes(rounds: &[Round]) -> Vec<String> {
    let (first, last) = (&rounds[0], &rounds[rounds.len() - 1]);
    let found = &last.identification;
    let mut said: Vec<String> = [determined(found), misfit(last)]
        .into_iter()
        .flatten()
        .collect();
    for pair in rounds.windows(2) {
        let refit = refuted(&pair[0], last);
        said.extend(refit);
        said.extend(held_out(&pair[0]));
    }
    let is_declared =
        |e: &&&'static dyn Effect| first.model.effects.iter().any(|o| o.name() == e.name());
    for effect in last.model.effects.iter().filter(|e| !is_declared(e)) {
        said.extend(impossible(*effect, &last.model, found));
    }
    // the place of what is left says more than the step
    said.extend(last.patches().objections());
    said.extend(steps_apart(last));
    said.extend(in_tension(last));
    for doubt in rounds.iter().flat_map(|r| &r.tracing.priors_in_doubt) {
        if !said.contains(&doubt.words) {
            said.push(doubt.words.clone());
        }
    }
    said
}

/// Constants that the data drive to absurd values.
fn determined(found: &Identification) -> Option<String> {
    (!found.determined)
        .then(|| "the constants are not determined: the data drive them beyond 6 prior sd".into())
}

/// 1. The misfit of block averages.
fn misfit(last: &Round) -> Option<String> {
    let misfit = &last.identification.misfit;
    let p = misfit.p;
    misfit
        .is_too_large()
        .then(|| format!("the misfit is larger than noise makes it ({})", chance(p)))
}

/// 2. The refit of what a round called for, in the last round, against the round without it.
pub fn refuted(before: &Round, last: &Round) -> Option<String> {
    let (model, refit) = (&last.model, &last.identification);
    let accepted = before.tracing.accepted.as_ref()?;
    let effect = accepted.effect;
    if model.effects.iter().all(|e| e.name() != effect.name()) {
        return None;
    }
    if effect.kind() == Kind::Recorded {
        // taken out of the field as it was found
        return None;
    }
    let refused = in_the_hole(model, refit).or_else(|| no_gain(before, refit, effect));
    if refused.is_some() {
        return refused;
    }
    // of several amplitudes only a combination may be known
    let [only] = effect.parameters() else {
        return None;
    };
    let (mean, sd) = refit.moments(&amplitude_name(effect, only))?;
    (mean.abs() <= ACTS_SDS * sd).then(|| {
        format!(
            "{} is not told from nothing once it is fitted",
            effect.name()
        )
    })
}

/// An effect whose addition does not lower the misfit, under one noise and over the same places and steps.
fn no_gain(before: &Round, refit: &Identification, effect: &dyn Effect) -> Option<String> {
    let [old, new] = [&before.identification, refit].map(|f| &f.left);
    if old[0].len() != new[0].len() {
        // points that are measured or dropped by what was found
        return None;
    }
    let posed = &refit.inverse.posed;
    let weighing = &refit.inverse.weighing;
    let both = [old.clone(), new.clone()];
    let norms = weighing
        .norms(&posed.measured, &posed.pairs[0], &both)
        .ok()?;
    (norms[1] >= norms[0]).then(|| format!("{} does not lower the misfit", effect.name()))
}

/// So many stray points may lie in a hole.
const STRAY: usize = 3;

/// Points that were measured between the edge of the declared hole and that of a refit, by two of its sds.
fn in_the_hole(model: &Model, refit: &Identification) -> Option<String> {
    let sure = |name: &str| {
        let (mean, sd) = refit.moments(name)?;
        Some((mean.abs() - ACTS_SDS * sd).max(0.0).copysign(mean))
    };
    let mut setup = model.scene().setup;
    let declared = setup.geometry.hole_radius()?;
    for acting in model.state(&sure).acting() {
        acting.effect.alter(&acting.amplitude, &mut setup);
    }
    let radius = setup.geometry.morphed(&setup.morph).ok()?.hole_radius()?;
    let points = refit.inverse.prepared.observation.field.points.iter();
    let inside = points
        .filter(|p| (declared..radius).contains(&p[0].hypot(p[1])))
        .count();
    (inside > STRAY)
        .then(|| format!("the hole that was fitted reaches over {inside} measured points"))
}

/// 3. Amplitudes that cannot be.
fn impossible(
    effect: &'static dyn Effect,
    model: &Model,
    found: &Identification,
) -> Option<String> {
    effect
        .parameters()
        .iter()
        .enumerate()
        .find_map(|(k, parameter)| {
            let name = amplitude_name(effect, parameter);
            let (mean, sd) = found.moments(&name)?;
            if parameter.positive && mean < 0.0 {
                return Some(format!(
                    "{name} is {}, and cannot be negative",
                    plus_minus(mean, sd)
                ));
            }
            let multiple = mean.abs() / model.prior_sd(effect, k)?;
            (multiple > LARGEST_MULTIPLE && effect.kind() != Kind::Recorded)
                .then(|| format!("{name} is {multiple:.1} times its plausible size"))
        })
}

/// 4. Prediction of held-out regions by what a round called for.
fn held_out(before: &Round) -> Option<String> {
    let effect = before.tracing.accepted.as_ref()?.effect;
    let group = before
        .tracing
        .groups
        .iter()
        .find(|g| g.leader == effect.name())?;
    (!group.predicts).then(|| format!("{} does not predict held-out regions", effect.name()))
}

/// 5. Steps of a series that the others do not predict, and what they leave: not the step that was last is to blame, but a part of all.
fn steps_apart(last: &Round) -> Option<String> {
    let steps = last
        .identification
        .inverse
        .prepared
        .observation
        .steps
        .as_ref()?;
    let traced = last.tracing.steps();
    let pairs = steps.names.iter().zip(traced);
    let far: Vec<(&String, f64)> = pairs
        .filter_map(|(name, step)| Some((name, step.predicted?.z)))
        .filter(|(_, z)| *z > STEP_SDS)
        .collect();
    if far.is_empty() {
        return None;
    }
    let names: Vec<&str> = far.iter().map(|(name, _)| name.as_str()).collect();
    let z: Vec<String> = far.iter().map(|(_, z)| format!("{z:.1}")).collect();
    let scales: Vec<f64> = traced.iter().map(|s| s.noise_scale.powi(2)).collect();
    let maps = last.tracing.series.as_ref()?.maps.as_ref();
    let part = maps.and_then(|m| largest_part(&m.left_nm, &steps.loads, &scales));
    let left = match part {
        Some(PatchPart::Load) => ", and most of what is left grows with the load".into(),
        Some(PatchPart::Common) => ", and most of what is left is the same in all pictures".into(),
        Some(PatchPart::Own(k)) => {
            format!(", and most of what is left is in {} alone", steps.names[k])
        }
        Some(PatchPart::Whole) | None => String::new(),
    };
    Some(format!(
        "the other steps do not predict {} (z = {}){left}",
        names.join(", "),
        z.join(", ")
    ))
}

/// 6. Experiments beside the field that contradict it, with all that was found.
fn in_tension(last: &Round) -> Option<String> {
    let tension = tension(last)?;
    let (p, percent) = (tension.p, tension.factor.percent);
    tension.contradicts().then(|| {
        format!("the field and the other experiments contradict each other whatever was found in the field ({}); by the field all moduli would be {percent:+.1} % off, as by a wrong force, thickness or width, or another batch", chance(p))
    })
}
