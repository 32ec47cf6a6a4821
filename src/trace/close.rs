//! Closing the loop: identify, find what is left, trace it to an effect, add the effect, identify again.

use std::time::Instant;

use super::attribute::attribute;
use super::averaged::Interval;
use super::conclusion::{Conclusion, Status, conclude};
use super::round::Round;
use crate::effect::{Effect, Kind, amplitude_name};
use crate::error::{Blame, Result};
use crate::files::Keyed;
use crate::identify::{Identification, Options, identify};
use crate::infer::Model;
use crate::progress::Progress;

/// All rounds and the conclusion.
pub struct Closed {
    /// Rounds, the first the model as it was given.
    pub rounds: Vec<Round>,
    /// The last model identified again with the unexplained structure as a correlated discrepancy, if some is left.
    pub with_discrepancy: Option<Identification>,
    pub conclusion: Conclusion,
}

/// Run rounds until nothing more is accepted, at most `most` refits, none begun after the deadline. `options` gives each
/// round its own. A later round that the deadline cuts off before there is anything to say of it does not count.
///
/// # Errors
/// Those of identification and tracing.
pub fn close<'a>(
    model: &Model,
    most: usize,
    options: &dyn Fn(usize) -> Options<'a>,
    progress: &dyn Progress,
) -> Result<Closed> {
    let mut rounds: Vec<Round> = Vec::new();
    let mut model = model.clone();
    loop {
        let deadline = options(rounds.len()).deadline;
        let is_over = || deadline.is_some_and(|end| Instant::now() >= end);
        let identification = match identify(&model, &options(rounds.len()), progress) {
            Err(e) if !rounds.is_empty() && e.blame() == Blame::Limit => break,
            other => other?,
        };
        let start = model.state(&|name| identification.moments(name).map(|(mean, _)| mean));
        let tracing = attribute(&model, &identification.inverse.prepared, start, progress)?;
        let go_on = rounds.len() < most && !is_over();
        let accepted = tracing.accepted.filter(|_| go_on);
        let amplitude = tracing.accepted_amplitude.clone();
        let averaged = tracing.averaged.clone();
        identification.inverse.prepared.problem.experiment.rest();
        rounds.push(Round {
            model: model.clone(),
            identification,
            tracing,
        });
        let Some(effect) = accepted else { break };
        model = extended(&model, effect, &amplitude, &averaged);
    }
    let conclusion = conclude(&rounds);
    let structure = rounds[rounds.len() - 1].tracing.structure;
    let options = Options {
        discrepancy: structure,
        ..options(rounds.len())
    };
    let wanted = conclusion.status == Status::Unexplained && structure.iter().any(Option::is_some);
    let over = || options.deadline.is_some_and(|end| Instant::now() >= end);
    let with_discrepancy = if wanted && !over() {
        match identify(&rounds[rounds.len() - 1].model, &options, progress) {
            Err(e) if e.blame() == Blame::Limit => None,
            other => Some(other?),
        }
    } else {
        None
    };
    Ok(Closed {
        rounds,
        with_discrepancy,
        conclusion,
    })
}

/// Half-width of the box of an added effect's amplitude: this many of its standard deviations, and this share of its prior's.
const BOX_SDS: f64 = 8.0;
const BOX_SHARE: f64 = 0.1;

/// The model with one more declared effect. The DoE box lies about the amplitude's estimate and the averaged posterior.
pub fn extended(
    model: &Model,
    effect: &'static dyn Effect,
    amplitude: &[(f64, f64)],
    averaged: &Keyed<Interval>,
) -> Model {
    let mut model = model.clone();
    narrow(&mut model, averaged);
    model
        .experiment_mut()
        .effects
        .push(effect.name().to_string());
    model.effects = crate::effect::EFFECTS
        .iter()
        .filter(|e| {
            model
                .experiment()
                .effects
                .iter()
                .any(|name| name == e.name())
        })
        .copied()
        .collect();
    if !matches!(effect.kind(), Kind::Additive | Kind::Recorded) {
        let prior_sd: Vec<f64> = effect
            .parameters()
            .iter()
            .enumerate()
            .map(|(k, p)| model.prior_sd(effect, k).unwrap_or(p.bound))
            .collect();
        let doe = model.file.reduced_model.doe.get_or_insert_default();
        let values = amplitude.iter().zip(prior_sd);
        for (parameter, ((mean, sd), prior_sd)) in effect.parameters().iter().zip(values) {
            let half = (BOX_SDS * sd)
                .max(BOX_SHARE * prior_sd)
                .min(3.0 * prior_sd.max(mean.abs()));
            let reach = parameter.bound;
            doe.insert(
                amplitude_name(effect, parameter),
                [(mean - half).max(-reach), (mean + half).min(reach)],
            );
        }
        model.ask_for_snapshots();
    }
    model
}

/// Half-width of the constants' box about the averaged posterior: this many of its sds, and this share of the value at least.
const CONSTANT_SDS: f64 = 8.0;
const CONSTANT_SHARE: f64 = 0.05;

/// Draw the DoE box in about the constants' averaged posterior, within the priors' box.
fn narrow(model: &mut Model, averaged: &Keyed<Interval>) {
    let widest = model.prior_box();
    let doe = model.file.reduced_model.doe.get_or_insert_default();
    for ((name, constant), widest) in averaged.iter().zip(widest) {
        let half = (CONSTANT_SDS * constant.sd).max(CONSTANT_SHARE * constant.mean.abs());
        let side = [
            (constant.mean - half).max(widest.low),
            (constant.mean + half).min(widest.high),
        ];
        if side[0] < side[1] {
            doe.insert(name.clone(), side);
        }
    }
}
