//! Closing the loop: identify, find what is left, trace it to an effect, add the effect, identify again.

use super::attribute::{Named, Tracing, attribute};
use super::averaged::Averaged;
use super::round::{Options, Round, identify};
use super::tangents::State;
use crate::effect::{Acting, Effect, Kind, amplitude_name};
use crate::error::Result;
use crate::infer::Model;
use crate::progress::Watch;

/// One identification and what tracing made of its residual.
pub struct Step {
    /// The model that was identified.
    pub model: Model,
    /// The identification.
    pub round: Round,
    /// What its residual says.
    pub tracing: Tracing,
}

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The residual is what the noise explains, and no effect was added.
    NothingMissing,
    /// Effects were added, and the residual is now what the noise explains.
    Closed,
    /// Structure remains that no effect of the dictionary explains.
    Unexplained,
}

impl Status {
    /// As `report.json` has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::NothingMissing => "nothing_missing",
            Self::Closed => "closed",
            Self::Unexplained => "unexplained",
        }
    }
}

/// What the loop concludes.
#[derive(Debug, Clone)]
pub struct Conclusion {
    /// How it ended.
    pub status: Status,
    /// Effects added, in order.
    pub effects: Vec<&'static str>,
    /// The alias group of each added effect that has one.
    pub alias_groups: Vec<Vec<&'static str>>,
    /// In words.
    pub text: String,
}

/// All rounds and the conclusion.
pub struct Closed {
    /// Rounds, the first the model as it was given.
    pub steps: Vec<Step>,
    /// The last model identified again with the unexplained structure as a correlated discrepancy, if some is left.
    pub honest: Option<Round>,
    /// The conclusion.
    pub conclusion: Conclusion,
}

/// Above this probability the structure left is called unexplained.
const UNEXPLAINED: f64 = 0.5;

/// Run rounds until nothing more is accepted, at most `most` refits. `options` gives each round its own.
///
/// # Errors
/// Those of identification and tracing.
pub fn close<'a>(
    model: &Model,
    most: usize,
    options: &dyn Fn(usize) -> Options<'a>,
    watch: &dyn Watch,
) -> Result<Closed> {
    let mut steps: Vec<Step> = Vec::new();
    let mut model = model.clone();
    loop {
        let round = identify(&model, &options(steps.len()), watch)?;
        let start = State::of(&model, &round);
        let tracing = attribute(&model, &round.prepared, start, watch)?;
        let accepted = tracing.accepted.filter(|_| steps.len() < most);
        let amplitude = tracing.accepted_amplitude.clone();
        let averaged = tracing.averaged.clone();
        steps.push(Step {
            model: model.clone(),
            round,
            tracing,
        });
        let Some(effect) = accepted else { break };
        model = extended(&model, effect, &amplitude, &averaged);
    }
    let conclusion = conclude(&steps);
    let structure = steps[steps.len() - 1].tracing.structure;
    let honest = if conclusion.status == Status::Unexplained {
        let options = Options {
            discrepancy: structure,
            ..options(steps.len())
        };
        Some(identify(&model, &options, watch)?)
    } else {
        None
    };
    Ok(Closed {
        steps,
        honest,
        conclusion,
    })
}

impl State {
    /// Posterior means of a round.
    pub fn of(model: &Model, round: &Round) -> Self {
        let mean = |name: &str| {
            let sampled = round
                .verdict
                .rows
                .iter()
                .find(|r| r.name == name)
                .map(|r| r.mean);
            let closed = || {
                round
                    .effect_amplitudes
                    .iter()
                    .find(|a| a.0 == name)
                    .map(|a| a.1)
            };
            sampled.or_else(closed)
        };
        Self::at(model, &mean)
    }

    /// The values that `mean` gives by name (`E1_GPa`, `load_misalignment.angle_deg`), border units; the prior's mean, or no
    /// amplitude, where it gives none.
    pub fn at(model: &Model, mean: &dyn Fn(&str) -> Option<f64>) -> Self {
        let constants = model
            .constants()
            .iter()
            .zip(model.marginals())
            .map(|(name, prior)| mean(name).unwrap_or(prior.mean))
            .collect();
        let acting = model
            .effects
            .iter()
            .map(|effect| Acting {
                effect: *effect,
                amplitude: effect
                    .parameters()
                    .iter()
                    .map(|p| mean(&amplitude_name(*effect, p)).unwrap_or(0.0))
                    .collect(),
            })
            .collect();
        Self { constants, acting }
    }
}

/// Half-width of the box of an added effect's amplitude: this many of its standard deviations, and this share of its prior's.
const BOX_SDS: f64 = 8.0;
const BOX_SHARE: f64 = 0.1;

/// The model with one more declared effect. The DoE box lies about the amplitude's estimate and the averaged posterior.
pub fn extended(
    model: &Model,
    effect: &'static dyn Effect,
    amplitude: &[(f64, f64)],
    averaged: &[Averaged],
) -> Model {
    let mut model = model.clone();
    narrow(&mut model, averaged);
    model.file.effects.push(effect.name().to_string());
    model.effects = crate::effect::EFFECTS
        .iter()
        .filter(|e| model.file.effects.iter().any(|name| name == e.name()))
        .copied()
        .collect();
    if !matches!(effect.kind(), Kind::Additive | Kind::Recorded) {
        let plausible: Vec<f64> = (0..effect.parameters().len())
            .map(|k| {
                model
                    .plausible(effect, k)
                    .unwrap_or(effect.parameters()[k].bound)
            })
            .collect();
        let doe = model.file.reduced_model.doe.get_or_insert_default();
        for (k, (parameter, (mean, sd))) in effect.parameters().iter().zip(amplitude).enumerate() {
            let plausible = plausible[k];
            let half = (BOX_SDS * sd)
                .max(BOX_SHARE * plausible)
                .min(3.0 * plausible.max(mean.abs()));
            let reach = parameter.bound;
            doe.insert(
                amplitude_name(effect, parameter),
                [(mean - half).max(-reach), (mean + half).min(reach)],
            );
        }
    }
    model
}

/// Half-width of the constants' box about the averaged posterior: this many of its sds, and this share of the value at least.
const CONSTANT_SDS: f64 = 8.0;
const CONSTANT_SHARE: f64 = 0.05;

/// Draw the DoE box in about the constants' averaged posterior, within the priors' box.
fn narrow(model: &mut Model, averaged: &[Averaged]) {
    let widest = model.prior_box();
    let doe = model.file.reduced_model.doe.get_or_insert_default();
    for (constant, widest) in averaged.iter().zip(widest) {
        let half = (CONSTANT_SDS * constant.sd).max(CONSTANT_SHARE * constant.mean.abs());
        let side = [
            (constant.mean - half).max(widest.low),
            (constant.mean + half).min(widest.high),
        ];
        if side[0] < side[1] {
            doe.insert(constant.name.clone(), side);
        }
    }
}

fn conclude(steps: &[Step]) -> Conclusion {
    let added: Vec<&Named> = steps
        .iter()
        .filter_map(|s| {
            let effect = s.tracing.accepted?;
            s.tracing.groups.iter().find(|g| g.leader == effect.name())
        })
        .take(steps.len().saturating_sub(1))
        .collect();
    let last = &steps[steps.len() - 1].tracing;
    let left = last.discrepancy > UNEXPLAINED;
    let status = match (left, added.is_empty()) {
        (true, _) => Status::Unexplained,
        (false, true) => Status::NothingMissing,
        (false, false) => Status::Closed,
    };
    Conclusion {
        status,
        effects: added.iter().map(|g| g.leader).collect(),
        alias_groups: added
            .iter()
            .filter(|g| g.members.len() > 1)
            .map(|g| g.members.clone())
            .collect(),
        text: words(status, &added, last),
    }
}

fn words(status: Status, added: &[&Named], last: &Tracing) -> String {
    let mut text = String::new();
    for group in added {
        let confirm = crate::effect::EFFECTS
            .iter()
            .find(|e| e.name() == group.leader)
            .map_or("", |e| e.confirm());
        text += &format!("The residual was consistent with {}", group.leader);
        let others: Vec<&str> = group
            .members
            .iter()
            .copied()
            .filter(|m| *m != group.leader)
            .collect();
        if !others.is_empty() {
            text += &format!(
                ", or with {}, which this measurement cannot tell from it",
                others.join(" or ")
            );
        }
        text += &format!(". What would confirm it: {confirm} ");
    }
    text += match status {
        Status::NothingMissing => {
            "The residual is what the measured noise explains: nothing asks for another effect."
        }
        Status::Closed => "What is left is what the measured noise explains.",
        Status::Unexplained => {
            "Structure is left that no effect of the dictionary explains; the averaged posterior counts it as a smooth discrepancy."
        }
    };
    text += " A scale of the load or of the thickness cannot be told from a common factor of all moduli: every percent of the one is a percent of the other, and only a calibrated load cell and a micrometer separate them.";
    if !last.undecided.is_empty() {
        let names: Vec<String> = last.undecided.iter().map(|g| g.join(" or ")).collect();
        text += &format!(" Undecided: {}.", names.join("; "));
    }
    text
}
