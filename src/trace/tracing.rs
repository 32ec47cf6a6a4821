//! What tracing found: candidates, alias groups, what is to be added, what could hide.

use serde::{Deserialize, Serialize};

use super::averaged::Interval;
use super::blind_spot::BlindSpot;
use super::patches::Patches;
use super::suspect::{ConditionalAnswer, PriorInDoubt, Suspect, UNEXPLAINED};
use crate::effect::Effect;
use crate::experiment::series::Law;
use crate::files::Keyed;
use crate::noise::series::Linearity;

/// An effect weighed against the data.
#[derive(Clone)]
pub struct Finding {
    pub effect: &'static dyn Effect,
    /// How its amplitude goes over the steps of a series.
    pub law: Option<Law>,
    /// Posterior probability that it acts.
    pub inclusion_probability: f64,
    /// Log Bayes factor for its acting.
    pub log_bayes_factor: f64,
    /// Mean and sd of each amplitude if it acts, border units.
    pub amplitude: Vec<(String, f64, f64)>,
    /// Largest amplitude over its prior sd.
    pub multiple: f64,
    /// Share of the structured part of chi^2 that it explains alone.
    pub explained_fraction: f64,
    /// Smallest amplitude of its first parameter that would have been found, border units.
    pub detectable: f64,
    /// Effects of its alias group, or else those of the most similar signatures, with their laws and the cosine.
    pub aliases: Vec<(&'static str, Option<Law>, f64)>,
}

impl Finding {
    /// Whether an amplitude that cannot be negative is.
    pub fn is_impossible(&self) -> bool {
        let mut parameters = self.effect.parameters().iter().zip(&self.amplitude);
        parameters.any(|(p, (_, mean, _))| p.positive && *mean < 0.0)
    }
}

/// The effect that is called for.
#[derive(Clone)]
pub struct Accepted {
    pub effect: &'static dyn Effect,
    /// Its amplitudes (mean, sd) a parameter, border units.
    pub amplitude: Vec<(f64, f64)>,
    /// How its amplitude goes over the steps of a series.
    pub law: Option<Law>,
    /// Prior sds of its amplitudes where a series was linearised, border units.
    pub plausible: Vec<(String, f64)>,
}

/// What a residual was traced to: complete when `Evidence::tracing` makes it.
pub struct Tracing {
    /// All candidates, the most probable first.
    pub candidates: Vec<Finding>,
    /// Alias groups of the best subset, by name, the strongest first, with probability, log evidence lost when it is dropped,
    /// and whether held-out blocks are predicted better with it.
    pub groups: Vec<Named>,
    /// The effect to add, if one is called for.
    pub accepted: Option<Accepted>,
    /// Of a series: what is left of its steps, and of all together.
    pub series: Option<SeriesResidual>,
    /// Groups that the data speak for without being sure.
    pub undecided: Vec<Vec<&'static str>>,
    /// Probability of smooth structure that no effect explains.
    pub discrepancy: f64,
    /// Correlation length (mm) of the likeliest noise or discrepancy of each component.
    pub length_mm: [f64; 2],
    /// The constants, averaged over what may act unseen.
    pub averaged: Keyed<Interval>,
    /// Whether the account of the residual is suspect, and what else the constants could be.
    pub suspect: Suspect,
    /// Constants whose prior the data contradict.
    pub priors_in_doubt: Vec<PriorInDoubt>,
    /// What the data alone say of constants that are their priors' more than the data's, in sentences.
    pub leaning: Vec<String>,
    /// What could hide in the residual.
    pub blind_spots: Vec<BlindSpot>,
    /// RMS error of held-out block averages by the model as it is, nm.
    pub holdout_rms_nm: f64,
    /// Effects left out, with the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// Places where the residual is not noise.
    pub patches: Patches,
}

impl Tracing {
    /// What is left of every step of a series; nothing of a single field.
    pub fn steps(&self) -> &[StepResidual] {
        self.series.as_ref().map_or(&[], |s| &s.residuals)
    }

    /// Whether smooth structure is left that no effect explains.
    pub fn leaves_structure(&self) -> bool {
        leaves_structure(self.discrepancy)
    }
}

/// Whether a discrepancy of some probability is structure that no effect explains.
pub fn leaves_structure(discrepancy: f64) -> bool {
    discrepancy > UNEXPLAINED
}

/// What tracing finds of a series.
pub struct SeriesResidual {
    /// What is left of every step.
    pub residuals: Vec<StepResidual>,
    /// What the declared model leaves of every step.
    pub maps: Option<StepMaps>,
    /// Whether the fields are proportional to the load.
    pub linearity: Option<Linearity>,
    /// Probability of a misfit as large by the series' own noise.
    pub misfit: Option<f64>,
    /// Where structure grows with the load: the stiffness that would make it.
    pub stiffness: Option<StiffnessField>,
    /// What the noise of a frame is, in a sentence.
    pub noise: String,
}

/// What is left of one step of a series: root mean squares of the block averages of (u1, u2), nm.
#[derive(Debug, Clone, Copy)]
pub struct StepResidual {
    /// By the model as it is declared.
    pub bare_nm: [f64; 2],
    /// With what it was traced to.
    pub explained_nm: [f64; 2],
    /// Noise of the step over the steps' typical one.
    pub noise_scale: f64,
    /// What the other steps say of it, where enough steps know the noise.
    pub predicted: Option<HeldOutStep>,
}

/// A step held out: predicted from all other steps, but for its own motion in the plane and what else is the step's own.
#[derive(Debug, Clone, Copy)]
pub struct HeldOutStep {
    /// Root mean square error of the block averages of (u1, u2), nm, by the model as it is declared.
    pub bare_nm: [f64; 2],
    /// With what it was traced to.
    pub explained_nm: [f64; 2],
    /// By how many sds the misfit of the step, given the others, is larger than the declared model expects.
    pub z: f64,
}

/// What the declared model leaves of every step, at the blocks of the field.
#[derive(Debug, Clone)]
pub struct StepMaps {
    /// Side of a block, and where blocks lie, mm.
    pub size_mm: f64,
    pub places: Vec<[f64; 2]>,
    /// Block averages of (u1, u2) of each step, nm.
    pub left_nm: Vec<[Vec<f64>; 2]>,
}

/// A field of the membrane stiffness, relative to that of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StiffnessField {
    /// Its probability against a discrepancy that no stiffness makes.
    pub probability: f64,
    /// The prior sd of the bumps at which it is largest.
    pub size: f64,
    /// Places (s, t), mm, with the relative change of the stiffness there and its sd.
    pub map: Vec<StiffnessAt>,
    /// The place where the change is most certain.
    pub surest: StiffnessAt,
    /// The constants where the stiffness varies so, or the discrepancy is of no mechanics, each with its probability.
    pub constants: Keyed<Interval>,
}

/// The relative change of the stiffness at a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StiffnessAt {
    pub at_mm: [f64; 2],
    pub change: f64,
    pub sd: f64,
}

impl StiffnessField {
    /// What is suspect with this beside it: the constants that it leaves are the averaged ones.
    pub fn explaining(&self, mut suspect: Suspect) -> Suspect {
        if let Some(first) = suspect.answers.first_mut() {
            first.supposing += ", with a stiffness that varies over the window";
            first.constants = self.constants.clone();
        }
        suspect.reasons.push(self.words());
        suspect
    }

    /// What it says, in a sentence.
    pub fn words(&self) -> String {
        let StiffnessAt {
            at_mm: [s, t],
            change,
            sd,
        } = self.surest;
        let low = if change < 0.0 { "low" } else { "high" };
        format!(
            "a membrane stiffness that varies over the window explains what grows with the load (probability {:.2} against other structure): \
             it is {low} at ({s:.1}, {t:.1}) mm along the load and across it, {:+.0} +- {:.0} %",
            self.probability,
            100.0 * change,
            100.0 * sd
        )
    }
}

#[derive(Debug, Clone)]
pub struct Named {
    /// The member with the largest evidence.
    pub leader: &'static str,
    /// How its amplitude goes over the steps of a series, the likeliest first, as far as the evidence does not tell.
    pub laws: Vec<Law>,
    /// All single members.
    pub members: Vec<&'static str>,
    /// Pairs that together could stand in.
    pub pairs: Vec<[&'static str; 2]>,
    /// Probability that some member acts.
    pub probability: f64,
    /// Log Bayes factor for it against its being dropped.
    pub log_bayes_factor: f64,
    /// Whether held-out blocks are predicted better with it.
    pub predicts: bool,
    /// Effects outside the group that leave almost the same field.
    pub resembling: Vec<Resembling>,
    /// A step that the others predict worse with it, counted from 0.
    pub spoiled: Option<usize>,
    /// The constants by accounts with and without the leader, where an error of the load is among them and they differ.
    pub rivals: Vec<ConditionalAnswer>,
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
    /// The largest of them over its prior sd.
    pub multiple: f64,
    /// Log Bayes factor for the leader against it in the leader's place.
    pub log_bayes_factor_lost: f64,
}

/// What is found of a test in other ways than by the evidence, before its tracing is put together.
#[derive(Default)]
pub struct FoundApart<'a> {
    /// Miscounted orders.
    pub jumps: Option<Finding>,
    /// The phase-shift error, with whether it is clear.
    pub phase: Option<(Finding, bool)>,
    /// The stiffness that explains structure which grows with the load.
    pub stiffness: Option<StiffnessField>,
    /// Patches that the residual holds.
    pub patches: Patches,
    /// Of a series: the prior sd of a parameter of an effect.
    pub series: Option<PriorSd<'a>>,
    /// Effects left out, with the reason.
    pub left_out: Vec<(&'static str, String)>,
}

/// Prior sd of a parameter of an effect, border units.
pub type PriorSd<'a> = &'a dyn Fn(&'static dyn Effect, usize) -> f64;

/// Candidates in their order, and what is called for.
pub struct Ranking {
    /// The most probable first.
    pub candidates: Vec<Finding>,
    /// The strongest first.
    pub groups: Vec<Named>,
    pub accepted: Option<Accepted>,
}

impl Ranking {
    /// With the effects of the recording, which are sought by their own ways: miscounted orders are accepted before anything else, a
    /// phase-shift error if nothing else has more evidence.
    #[must_use]
    pub fn with_recorded(mut self, jumps: Option<Finding>, phase: Option<(Finding, bool)>) -> Self {
        let accepted = self.accepted.as_ref().map(|a| a.effect.name());
        let strongest = accepted
            .and_then(|name| self.groups.iter().find(|g| g.leader == name))
            .map_or(f64::NEG_INFINITY, |g| g.log_bayes_factor);
        let mut called_for = None;
        if let Some((found, clear)) = phase {
            if clear && found.log_bayes_factor > strongest {
                called_for = Some(Accepted::recorded(&found));
            }
            if clear {
                self.groups.push(Named::alone(&found));
            }
            self.candidates.push(found);
        }
        if let Some(found) = jumps {
            called_for = Some(Accepted::recorded(&found));
            self.groups.push(Named::alone(&found));
            self.candidates.push(found);
        }
        self.candidates.sort_by(|a, b| {
            b.inclusion_probability
                .total_cmp(&a.inclusion_probability)
                .then_with(|| b.log_bayes_factor.total_cmp(&a.log_bayes_factor))
        });
        Self {
            accepted: called_for.or(self.accepted),
            ..self
        }
    }
}

impl Accepted {
    /// An effect of the recording, which is corrected as it was found.
    fn recorded(found: &Finding) -> Self {
        Self {
            effect: found.effect,
            amplitude: found.amplitude.iter().map(|(_, m, s)| (*m, *s)).collect(),
            law: None,
            plausible: Vec::new(),
        }
    }
}

impl Named {
    /// The group of an effect that nothing else in the dictionary resembles.
    fn alone(found: &Finding) -> Self {
        Self {
            leader: found.effect.name(),
            laws: Vec::new(),
            members: vec![found.effect.name()],
            pairs: Vec::new(),
            probability: found.inclusion_probability,
            log_bayes_factor: found.log_bayes_factor,
            predicts: true,
            resembling: Vec::new(),
            spoiled: None,
            rivals: Vec::new(),
        }
    }
}
