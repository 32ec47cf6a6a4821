//! What tracing found, gathered for the report.

use serde_json::{Value, json};

use super::tracing::{
    AliasGroupReport, AliasReport, AmplitudeReport, CandidateReport, LeftOut, TracingReport,
};
use crate::parameter::Parameter;
use crate::trace::{Finding, LARGEST_MULTIPLE, Named, Resembling, Tracing, texts};

/// What one tracing found.
pub fn tracing(tracing: &Tracing) -> TracingReport {
    TracingReport {
        candidates: map(&tracing.candidates, candidate),
        groups: map(&tracing.groups, group),
        accepted: tracing
            .accepted
            .iter()
            .map(|a| a.effect.name().into())
            .collect(),
        undecided: map(&tracing.undecided, |g| texts(g)),
        discrepancy_probability: tracing.discrepancy,
        averaged_posterior: tracing.averaged.clone(),
        left_out: map(&tracing.left_out, |(effect, reason)| LeftOut {
            effect: (*effect).into(),
            reason: reason.clone(),
        }),
    }
}

/// `trace.json`.
pub fn trace_file(tracing: &Tracing, found: &TracingReport) -> Value {
    json!({
        "schema": "plychain-trace/1",
        "candidates": found.candidates,
        "groups": found.groups,
        "accepted": found.accepted.first(),
        "undecided": found.undecided,
        "discrepancy_probability": found.discrepancy_probability,
        "length_mm": { "u1": tracing.length_mm[0], "u2": tracing.length_mm[1] },
        "holdout_rms_nm": tracing.holdout_rms_nm,
        "averaged_posterior": found.averaged_posterior,
        "suspect": tracing.suspect,
        "stiffness": tracing.series.as_ref().and_then(|s| s.stiffness.as_ref()),
        "blind_spots": tracing.blind_spots,
        "left_out": found.left_out,
    })
}

/// `effect.parameter` without the effect.
fn parameter(name: &str) -> String {
    Parameter::read(name).own
}

fn candidate(found: &Finding) -> CandidateReport {
    CandidateReport {
        effect: found.effect.name().into(),
        law: found.law,
        inclusion_probability: found.inclusion_probability,
        log_bayes_factor: found.log_bayes_factor,
        amplitude: map(&found.amplitude, |(name, mean, sd)| AmplitudeReport {
            parameter: parameter(name),
            mean: *mean,
            sd: *sd,
        }),
        plausible_multiple: found.multiple,
        implausible: found.multiple > LARGEST_MULTIPLE,
        explained_fraction: found.explained_fraction,
        detectable: found.detectable,
        aliases: map(&found.aliases, |(effect, law, cosine)| AliasReport {
            effect: (*effect).into(),
            law: *law,
            cosine: *cosine,
        }),
    }
}

fn group(group: &Named) -> AliasGroupReport {
    let outside = group
        .resembling
        .iter()
        .filter(|r| !group.members.contains(&r.effect));
    AliasGroupReport {
        leader: group.leader.into(),
        laws: group.laws.clone(),
        members: texts(&group.members),
        pairs: map(&group.pairs, |pair| pair.map(String::from)),
        resembling: outside.map(resembling).collect(),
        probability: group.probability,
        log_evidence_lost_without: group.log_bayes_factor,
        predicts_held_out_blocks: group.predicts,
    }
}

fn resembling(other: &Resembling) -> Value {
    json!({
        "effect": other.effect,
        "cosine": other.cosine,
        "amplitude": map(&other.amplitude, |(name, value)| json!({ "parameter": parameter(name), "value": value })),
        "plausible_multiple": other.multiple,
        "log_evidence_lost": other.log_bayes_factor_lost,
    })
}

pub(super) fn map<T, U>(items: &[T], of: impl Fn(&T) -> U) -> Vec<U> {
    items.iter().map(of).collect()
}
