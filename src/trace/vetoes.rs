//! What forbids a verdict of `closed` or `nothing_missing`, one function a condition. Each says in words what it objects to.

use super::averaged::Interval;
use super::evidence::LARGEST_MULTIPLE;
use super::patches::{PatchPart, largest_part};
use super::round::Round;
use super::together::tension;
use crate::effect::{Effect, Kind, amplitude_name};
use crate::identify::{Identification, MISFIT};
use crate::infer::Model;
use crate::quantity::plus_minus;

/// Largest error of the reduced model, posterior sds, and share of draws outside its box.
const SURROGATE_SDS: f64 = 0.05;
const OUTSIDE: f64 = 0.01;

/// A refit and its tracing agree within so many combined sds, and a refit lies so many sds from zero.
const AGREE_SDS: f64 = 4.0;
const ACTS_SDS: f64 = 2.0;

/// By so many prior sds a traced amplitude may be off, because it is that beside the other effects of the best subset.
const CONDITIONAL: f64 = 0.1;

/// The quoted posterior and the last model's agree within so many combined sds.
const QUOTED_SDS: f64 = 3.0;

/// A step is predicted by all others within so many sds of its misfit (prototype study).
const STEP_SDS: f64 = 4.5;

/// All objections to the last round of a loop but that to its reduced model ([`surrogate`]).
pub fn vetoes(rounds: &[Round]) -> Vec<String> {
    let (first, last) = (&rounds[0], &rounds[rounds.len() - 1]);
    let found = &last.identification;
    let mut said: Vec<String> = [determined(found), misfit(last)]
        .into_iter()
        .flatten()
        .collect();
    for pair in rounds.windows(2) {
        let refit = contradiction(&pair[0], &pair[1].model, &last.identification);
        said.extend(refit);
        said.extend(held_out(&pair[0]));
    }
    let is_declared =
        |e: &&&'static dyn Effect| first.model.effects.iter().any(|o| o.name() == e.name());
    for effect in last.model.effects.iter().filter(|e| !is_declared(e)) {
        said.extend(impossible(*effect, &last.model, found));
    }
    said.extend(quoted(last));
    said.extend(steps_apart(last));
    said.extend(last.patches().objections());
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

/// 1. The reduced model at draws of the posterior: what it does to the constants. Amplitudes of effects are quoted from elsewhere.
pub fn surrogate(found: &Identification) -> Option<String> {
    let error = found.surrogate.max_sd_of_constants();
    if error > SURROGATE_SDS {
        let percent = 100.0 * error;
        return Some(format!(
            "the reduced model is {percent:.0} % of a posterior sd off, after refinement"
        ));
    }
    let percent = 100.0 * found.outside_doe;
    (found.outside_doe > OUTSIDE).then(|| {
        format!(
            "{percent:.1} % of the draws lie outside the box of the reduced model, after refinement"
        )
    })
}

/// 2. The misfit of modes and of block averages.
fn misfit(last: &Round) -> Option<String> {
    let misfit = &last.identification.misfit;
    let p = misfit.p;
    misfit
        .is_too_large()
        .then(|| format!("the misfit is larger than noise makes it (p = {p:.0e})"))
}

/// 3. The refit of what a round called for against its tracing.
pub fn contradiction(before: &Round, model: &Model, refit: &Identification) -> Option<String> {
    let accepted = before.tracing.accepted.as_ref()?;
    let effect = accepted.effect;
    if model.effects.iter().all(|e| e.name() != effect.name()) {
        return None;
    }
    if effect.kind() == Kind::Recorded {
        // taken out of the field as it was found
        return None;
    }
    let over_points = in_the_hole(model, refit);
    if over_points.is_some() {
        return over_points;
    }
    let mut acts = false;
    let traced = accepted.amplitude.iter();
    for (k, (parameter, &(traced, traced_sd))) in effect.parameters().iter().zip(traced).enumerate()
    {
        let name = amplitude_name(effect, parameter);
        let (mean, sd) = refit.moments(&name)?;
        // where the specimen stands is nothing to hold a fit against
        let prior_sd = model.prior_sd(effect, k)?;
        let combined = sd.hypot(traced_sd).hypot(CONDITIONAL * prior_sd);
        if (mean - traced).abs() > AGREE_SDS * combined {
            return Some(format!(
                "{name} is {} when fitted, and {} when traced",
                plus_minus(mean, sd),
                plus_minus(traced, traced_sd)
            ));
        }
        acts |= mean.abs() > ACTS_SDS * sd;
    }
    // of several amplitudes only a combination may be known
    let alone = effect.parameters().len() == 1;
    (alone && !acts).then(|| {
        format!(
            "{} is not told from nothing once it is fitted",
            effect.name()
        )
    })
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

/// 4. Amplitudes that cannot be.
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

/// 5. The quoted constants against the last model's.
fn quoted(last: &Round) -> Option<String> {
    let far = |(name, quoted): (&String, &Interval)| {
        let (mean, sd) = last.identification.moments(name)?;
        let sds = (quoted.mean - mean) / sd.hypot(quoted.sd);
        (sds.abs() > QUOTED_SDS)
            .then(|| format!("the quoted {name} lies {sds:+.1} sd from that of the last model"))
    };
    last.tracing.averaged.iter().find_map(far)
}

/// 6. Prediction of held-out regions by what a round called for.
fn held_out(before: &Round) -> Option<String> {
    let effect = before.tracing.accepted.as_ref()?.effect;
    let group = before
        .tracing
        .groups
        .iter()
        .find(|g| g.leader == effect.name())?;
    (!group.predicts).then(|| format!("{} does not predict held-out regions", effect.name()))
}

/// 7. Steps of a series that the others do not predict, and what they leave: not the step that was last is to blame, but a part of all.
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

/// 8. Experiments beside the field that contradict it, with all that was found.
fn in_tension(last: &Round) -> Option<String> {
    let p = tension(last)?.p;
    (p < MISFIT).then(|| {
        format!("field and frequencies contradict each other whatever was found in the field (p = {p:.0e})")
    })
}
