//! The numbers of tracing and of the loop: what `report.json` has beyond identification.

use serde_json::{Map, Value, json};

use super::numbers::{SCHEMA, round_numbers};
use super::widening::{self, Alone};
use crate::identify::PRIOR_SDS;
use crate::trace::{
    Averaged, BlindSpot, Closed, Confirming, Found, Named, Resembling, Round, Status, Tracing,
};

/// `report.json` of a loop.
pub fn report(closed: &Closed, seed: u64) -> Value {
    let steps = &closed.rounds;
    let last = &steps[steps.len() - 1];
    let conclusion = &closed.conclusion;
    json!({
        "schema": SCHEMA,
        "model": last.model.file.name,
        "seed": seed,
        "rounds": steps.iter().map(step).collect::<Vec<_>>(),
        "averaged_posterior": averaged(&last.tracing.averaged),
        "averaged_note": widening::note(&alone(last), &last.tracing),
        "with_discrepancy": closed.with_discrepancy.as_ref().map(|round| round_numbers(&last.model, round)),
        "blind_spots": blind_spots(&last.tracing),
        "before_after": before_after(steps),
        "verdict": {
            "status": conclusion.status.name(),
            "effects": conclusion.effects,
            "alias_groups": conclusion.alias_groups,
            "undecided": last.tracing.undecided,
            "text": conclusion.text,
            "confirm": conclusion.confirm.iter().map(confirming).collect::<Vec<_>>(),
        },
    })
}

/// Mean and sd of each constant by a round's model alone.
pub fn alone(step: &Round) -> Alone {
    let constants = step.model.constants().iter();
    constants
        .filter_map(|name| Some(((*name).to_string(), step.identification.moments(name)?)))
        .collect()
}

fn confirming(group: &Confirming) -> Value {
    let test = |(effect, test): &(&str, &str)| json!({ "effect": effect, "test": test });
    json!({ "added": group.added, "tests": group.tests.iter().map(test).collect::<Vec<_>>() })
}

/// `trace.json`: what one tracing found.
pub fn traced(tracing: &Tracing) -> Value {
    json!({
        "schema": "plychain-trace/1",
        "candidates": candidates(tracing),
        "groups": groups(tracing),
        "accepted": tracing.accepted.map(|e| e.name()),
        "undecided": tracing.undecided,
        "discrepancy_probability": tracing.discrepancy,
        "length_mm": { "u1": tracing.length_mm[0], "u2": tracing.length_mm[1] },
        "holdout_rms_nm": tracing.holdout_rms_nm,
        "averaged_posterior": averaged(&tracing.averaged),
        "blind_spots": blind_spots(tracing),
        "left_out": left_out(tracing),
    })
}

fn step(step: &Round) -> Value {
    let tracing = &step.tracing;
    let mut round = round_numbers(&step.model, &step.identification);
    if let Some(residual) = round.get_mut("residual").and_then(Value::as_object_mut) {
        residual.insert("holdout_rms_nm".into(), number(tracing.holdout_rms_nm));
    }
    let more = [
        ("candidates", candidates(tracing)),
        ("groups", groups(tracing)),
        (
            "accepted",
            json!(
                tracing
                    .accepted
                    .iter()
                    .map(|e| e.name())
                    .collect::<Vec<_>>()
            ),
        ),
        ("undecided", json!(tracing.undecided)),
        ("discrepancy_probability", number(tracing.discrepancy)),
        ("averaged_posterior", averaged(&tracing.averaged)),
        ("left_out", left_out(tracing)),
    ];
    if let Some(round) = round.as_object_mut() {
        round.extend(more.map(|(key, value)| (key.to_string(), value)));
    }
    round
}

/// JSON has no infinity: `null` stands for what no amplitude reaches.
fn number(x: f64) -> Value {
    json!(x.is_finite().then_some(x))
}

fn resembling(other: &Resembling) -> Value {
    let amplitude = other.amplitude.iter().map(|(name, value)| {
        json!({ "parameter": name.rsplit('.').next().unwrap_or(name), "value": value })
    });
    json!({
        "effect": other.effect,
        "cosine": other.cosine,
        "amplitude": amplitude.collect::<Vec<_>>(),
        "plausible_multiple": number(other.multiple),
        "log_evidence_lost": number(other.log_bayes_factor_lost),
    })
}

fn candidates(tracing: &Tracing) -> Value {
    tracing.candidates.iter().map(candidate).collect()
}

fn candidate(found: &Found) -> Value {
    json!({
        "effect": found.effect.name(),
        "inclusion_probability": found.inclusion_probability,
        "log_bayes_factor": number(found.log_bayes_factor),
        "amplitude": found.amplitude.iter().map(|(name, mean, sd)| {
            let parameter = name.rsplit('.').next().unwrap_or(name);
            json!({ "parameter": parameter, "mean": mean, "sd": sd })
        }).collect::<Vec<_>>(),
        "plausible_multiple": number(found.multiple),
        "implausible": found.multiple > IMPLAUSIBLE,
        "explained_fraction": found.explained_fraction,
        "detectable": number(found.detectable),
        "aliases": found.aliases.iter().map(|(name, cosine)| json!({ "effect": name, "cosine": cosine })).collect::<Vec<_>>(),
    })
}

/// Amplitudes of more prior sds are flagged.
pub const IMPLAUSIBLE: f64 = 4.0;

/// Shifts of a constant are by sensitivities; beyond this many percent of it they say no more than that they are large.
pub const LINEAR_PERCENT: f64 = 20.0;

/// What those shifts mean, in a sentence.
pub const LINEAR: &str = "Shifts are by the sensitivities of the model, which hold for small ones: beyond 20 % only the direction and that the shift is large can be said.";

/// Cosine from which an effect is shown as one that resembles another.
pub const ALIKE: f64 = 0.5;

/// From this probability on it is said what an effect explains: an improbable one, alone, takes what a probable one explains.
pub const PROBABLE: f64 = 0.5;

/// A shift in percent; beyond [`LINEAR_PERCENT`] that it is.
pub fn shift(percent: f64, decimals: usize) -> String {
    match percent {
        s if s > LINEAR_PERCENT => format!("> +{LINEAR_PERCENT}"),
        s if s < -LINEAR_PERCENT => format!("< -{LINEAR_PERCENT}"),
        s if s.abs() < 0.5 * 10_f64.powi(-(decimals as i32)) => "0".into(),
        s => format!("{s:+.decimals$}"),
    }
}

fn groups(tracing: &Tracing) -> Value {
    let group = |g: &Named| {
        json!({
            "leader": g.leader, "members": g.members, "pairs": g.pairs,
            "resembling": g.resembling.iter().map(resembling).collect::<Vec<_>>(),
            "probability": g.probability, "log_evidence_lost_without": number(g.log_bayes_factor),
            "predicts_held_out_blocks": g.predicts,
        })
    };
    tracing.groups.iter().map(group).collect()
}

fn averaged(constants: &[Averaged]) -> Value {
    let constant = |a: &Averaged| {
        let value = json!({ "mean": a.mean, "sd": a.sd, "q2.5": a.low, "median": a.median, "q97.5": a.high });
        (a.name.clone(), value)
    };
    Value::Object(constants.iter().map(constant).collect::<Map<_, _>>())
}

fn blind_spots(tracing: &Tracing) -> Value {
    tracing
        .blind_spots
        .iter()
        .map(|(effect, spot)| blind_spot(effect, spot))
        .collect()
}

fn blind_spot(effect: &str, spot: &BlindSpot) -> Value {
    let parameter = spot.parameter.rsplit('.').next().unwrap_or(&spot.parameter);
    let shifts: Map<String, Value> = spot
        .shift_percent
        .iter()
        .map(|(name, shift)| (name.clone(), number(*shift)))
        .collect();
    let beyond: Vec<&String> = spot
        .shift_percent
        .iter()
        .filter(|(_, shift)| shift.abs() > LINEAR_PERCENT)
        .map(|(name, _)| name)
        .collect();
    json!({
        "effect": effect, "parameter": parameter, "plausible": spot.plausible, "unit": unit(parameter),
        "shift_in_percent": shifts, "beyond_linear": beyond, "detectable": number(spot.detectable),
        "would_be_seen": spot.detectable < spot.plausible,
    })
}

/// The unit in a parameter's name: `angle_deg` deg, `uniform_per_m` 1/m, `gradient_per_m_per_mm` 1/(m mm), `percent_at_12mm` percent.
pub fn unit(parameter: &str) -> String {
    let parameter = parameter.split("_at_").next().unwrap_or(parameter);
    let mut parts = parameter.split("_per_");
    let head = parts.next().unwrap_or(parameter);
    let below: Vec<&str> = parts.collect();
    match below[..] {
        [] => head.rsplit('_').next().unwrap_or(head).to_string(),
        [one] => format!("1/{one}"),
        _ => format!("1/({})", below.join(" ")),
    }
}

fn left_out(tracing: &Tracing) -> Value {
    tracing
        .left_out
        .iter()
        .map(|(name, reason)| json!({ "effect": name, "reason": reason }))
        .collect()
}

fn before_after(steps: &[Round]) -> Value {
    let [first, last] = [&steps[0], &steps[steps.len() - 1]];
    let pair = |f: &dyn Fn(&Round) -> f64| json!([number(f(first)), number(f(last))]);
    let residual = |c: usize| move |s: &Round| s.identification.residual.rms_nm[c];
    json!({
        "residual_rms_nm": pair(&|s| s.identification.residual.rms_all_nm()),
        "residual_rms_u1_nm": pair(&residual(0)),
        "residual_rms_u2_nm": pair(&residual(1)),
        "chi2_reduced": pair(&|s| s.identification.residual.chi2_reduced),
        "holdout_rms_nm": pair(&|s| s.tracing.holdout_rms_nm),
        "posterior": constants(first, last),
    })
}

/// Mean and sd of every constant before and after, the shift in sds before, and how far from the prior's mean both are.
fn constants(first: &Round, last: &Round) -> Map<String, Value> {
    let rows = |s: &'_ Round| s.identification.verdict.rows.clone();
    let after = rows(last);
    rows(first)
        .iter()
        .filter_map(|before| {
            let after = after.iter().find(|r| r.name == before.name)?;
            let value = json!({
                "mean": [before.mean, after.mean], "sd": [before.sd, after.sd],
                "shift_in_sd": (after.mean - before.mean) / before.sd,
                "from_prior_in_prior_sd": [from_prior(first, &before.name), from_prior(last, &before.name)],
            });
            Some((before.name.clone(), value))
        })
        .collect()
}

/// How far a constant's posterior mean lies from its prior's, prior sds.
pub fn from_prior(step: &Round, name: &str) -> Option<f64> {
    let k = step.model.constants().iter().position(|n| *n == name)?;
    let prior = step.model.marginals()[k];
    Some((step.identification.moments(name)?.0 - prior.mean) / prior.sd)
}

/// What is said of a constant that lies `sds` prior sds from its prior's mean, if it is too far.
pub fn contradiction(sds: f64) -> Option<String> {
    (sds.abs() > PRIOR_SDS).then(|| format!("contradicts the prior by {sds:+.1} sd"))
}

/// The verdict in one line.
pub fn headline(status: Status) -> &'static str {
    match status {
        Status::NothingMissing => "nothing missing",
        Status::Closed => "closed",
        Status::Unexplained => "unexplained structure remains",
    }
}
