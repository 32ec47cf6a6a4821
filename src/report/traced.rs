//! The numbers of tracing and of the loop: what `report.json` has beyond identification.

use serde_json::{Map, Value, json};

use super::numbers::{SCHEMA, round_numbers};
use crate::trace::{Averaged, BlindSpot, Closed, Found, Named, Status, Step, Tracing};

/// `report.json` of a loop.
pub fn report(closed: &Closed, seed: u64) -> Value {
    let steps = &closed.steps;
    let last = &steps[steps.len() - 1];
    let conclusion = &closed.conclusion;
    json!({
        "schema": SCHEMA,
        "model": last.model.file.name,
        "seed": seed,
        "rounds": steps.iter().map(step).collect::<Vec<_>>(),
        "averaged_posterior": averaged(&last.tracing.averaged),
        "with_discrepancy": closed.honest.as_ref().map(|round| round_numbers(&last.model, round)),
        "blind_spots": blind_spots(&last.tracing),
        "before_after": before_after(steps),
        "verdict": {
            "status": conclusion.status.name(),
            "effects": conclusion.effects,
            "alias_groups": conclusion.alias_groups,
            "undecided": last.tracing.undecided,
            "text": conclusion.text,
        },
    })
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

fn step(step: &Step) -> Value {
    let tracing = &step.tracing;
    let mut round = round_numbers(&step.model, &step.round);
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

fn groups(tracing: &Tracing) -> Value {
    let group = |g: &Named| {
        json!({
            "leader": g.leader, "members": g.members, "pairs": g.pairs,
            "probability": g.probability, "log_evidence_lost_without": number(g.drop_nats),
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
    json!({
        "effect": effect, "parameter": parameter, "plausible": spot.plausible, "unit": unit(parameter),
        "shift_in_percent": shifts, "detectable": number(spot.detectable),
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

fn before_after(steps: &[Step]) -> Value {
    let [first, last] = [&steps[0], &steps[steps.len() - 1]];
    let pair = |f: &dyn Fn(&Step) -> f64| json!([number(f(first)), number(f(last))]);
    let residual = |c: usize| move |s: &Step| s.round.residual.rms_nm[c];
    json!({
        "residual_rms_nm": pair(&|s| s.round.residual.rms_all_nm()),
        "residual_rms_u1_nm": pair(&residual(0)),
        "residual_rms_u2_nm": pair(&residual(1)),
        "chi2_reduced": pair(&|s| s.round.residual.chi2_reduced),
        "holdout_rms_nm": pair(&|s| s.tracing.holdout_rms_nm),
        "posterior": constants(first, last),
    })
}

/// Mean and sd of every constant before and after, and the shift in sds before.
fn constants(first: &Step, last: &Step) -> Map<String, Value> {
    let rows = |s: &'_ Step| s.round.verdict.rows.clone();
    let after = rows(last);
    rows(first)
        .iter()
        .filter_map(|before| {
            let after = after.iter().find(|r| r.name == before.name)?;
            let value = json!({
                "mean": [before.mean, after.mean], "sd": [before.sd, after.sd],
                "shift_in_sd": (after.mean - before.mean) / before.sd,
            });
            Some((before.name.clone(), value))
        })
        .collect()
}

/// The verdict in one line.
pub fn headline(status: Status) -> &'static str {
    match status {
        Status::NothingMissing => "nothing missing",
        Status::Closed => "closed",
        Status::Unexplained => "unexplained structure remains",
    }
}
