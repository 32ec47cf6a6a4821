//! Verdicts as a whole: constants, forces, motion, noise and up to three effects are drawn, a measurement is simulated, the loop is closed on
//! it, and its names and intervals are compared with what acted. The oracle is the same loop, told which effects act and not how large they are:
//! they are declared, and nothing is added. Only the side of subsets is told. The oracle's posterior is its closed form.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::calibration::model_of;
use super::drawn::{Acts, Drawn};
use super::replicates::{Numbered, ReplicatePlan, replicates};
use super::whole_loop::{OF_THE_LOOP, ROUNDS, held, measured, options, refuse_unknown_forces};
use crate::diagnose::sorted;
use crate::error::Result;
use crate::files::Keyed;
use crate::infer::{EffectUnderLaw, Model};
use crate::numeric::quantile;
use crate::progress::{Progress, Silent};
use crate::sample::SAMPLERS;
use crate::trace::{Accepted, Interval, LoopStage, Status, close, explain, extended};

/// Effects that act, at most.
pub const MOST: usize = 3;

/// What the verdicts of a loop are asked of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct VerdictPlan {
    /// Effects that act, at most; any number up to this one, equally often.
    pub effects: usize,
    /// Whether the posterior to quote is sampled; else its closed form is judged.
    pub whole: bool,
}

/// An effect that acted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ActedEffect {
    pub effect: String,
    /// How its amplitude goes over the steps of a series.
    pub law: Option<String>,
    /// Whether its first amplitude is so large that the first round would have found it, if nothing else acted.
    pub shows: bool,
}

/// One line of the record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct VerdictReplicate {
    pub replicate: usize,
    pub acted: Vec<ActedEffect>,
    /// Alias groups that the loop named; one effect where it stands alone.
    pub named: Vec<Vec<String>>,
    pub status: String,
    /// Whether the 95 % interval to quote holds each constant.
    pub held: Vec<bool>,
    /// Root mean square distance of the constants from those that the oracle quotes, in its sds: by the model as it was given, and as quoted.
    pub bias: [f64; 2],
}

impl Numbered for VerdictReplicate {
    fn replicate(&self) -> usize {
        self.replicate
    }
}

impl VerdictReplicate {
    fn acts(&self, name: &str) -> bool {
        self.acted.iter().any(|acted| acted.effect == name)
    }

    fn is_null(&self) -> bool {
        self.acted.is_empty()
    }

    /// Whether an effect is named, alone or in a group.
    fn names(&self, effect: &str) -> bool {
        self.named.iter().flatten().any(|name| name == effect)
    }

    /// Whether all that acted is named, and no group but those in which something acted.
    fn is_exact(&self) -> bool {
        self.acted.iter().all(|a| self.names(&a.effect)) && self.false_names() == 0
    }

    /// Names that stand alone.
    fn alone(&self) -> impl Iterator<Item = &String> {
        let alone = self.named.iter().filter(|group| group.len() == 1);
        alone.flatten()
    }

    /// Groups of which no member acted.
    fn false_names(&self) -> usize {
        let outside = |group: &&Vec<String>| !group.iter().any(|name| self.acts(name));
        self.named.iter().filter(outside).count()
    }

    fn is_explained(&self) -> bool {
        self.status != Status::Unexplained.words()
    }
}

/// Run or go on with a record at `path`, and return all replicates.
///
/// # Errors
/// A record of another plan; what simulation and the loop may fail with.
pub fn verdicts(
    model: &Model,
    plan: &ReplicatePlan,
    asked: VerdictPlan,
    (cache, path): (&Path, &Path),
    progress: &dyn Progress,
) -> Result<Vec<VerdictReplicate>> {
    let model = &model_of(model);
    refuse_unknown_forces(model)?;
    let one = |k: usize| {
        let found = |model: &Model, drawn: &Drawn| judged(model, (plan, asked), k, drawn, cache);
        measured(model, plan, (Acts::UpTo(asked.effects), k), path, &found)
    };
    let of = (path, &(RECORD, asked, &model.file));
    replicates(of, plan, (OF_THE_LOOP, &one), progress)
}

/// Format of a record; replicates of format 1 had another oracle, those of format 2 other fields.
const RECORD: &str = "plychain-verdicts/3";

/// Close the loop on a measurement, and compare with what is true.
fn judged(
    model: &Model,
    (plan, asked): (&ReplicatePlan, VerdictPlan),
    replicate: usize,
    drawn: &Drawn,
    cache: &Path,
) -> Result<VerdictReplicate> {
    let sampler = (SAMPLERS[0].build)();
    let options = |stage: LoopStage| options(&*sampler, plan, (replicate, stage), cache);
    let (rounds, conclusion, intervals) = if asked.whole {
        let closed = close(model, ROUNDS, &options, &Silent)?;
        let intervals = closed.quoted();
        (closed.rounds, closed.conclusion, intervals)
    } else {
        let explained = explain(model, ROUNDS, &options, &Silent)?;
        let intervals = explained.closed_form();
        (explained.rounds, explained.conclusion, intervals)
    };
    let first = &rounds[0];
    let acted = |acts: &EffectUnderLaw| {
        let mut found = first.tracing.candidates.iter();
        let found = found.find(|f| f.effect.name() == acts.effect.name() && f.law == acts.law);
        let size = drawn.amplitude(acts).first().map_or(0.0, |a| a.abs());
        ActedEffect {
            effect: acts.effect.name().to_string(),
            law: acts.law.map(|law| law.key()),
            shows: found.is_some_and(|f| size > f.detectable),
        }
    };
    let group = |name: &String| {
        let mut groups = conclusion.alias_groups.iter();
        let own = groups.find(|g| g.contains(name)).cloned();
        own.unwrap_or_else(|| vec![name.clone()])
    };
    let bias = match drawn.acted.is_empty() {
        true => [0.0; 2],
        false => {
            let model = oracle(model, drawn, &first.tracing.averaged);
            let of_oracle = |stage: LoopStage| match stage {
                LoopStage::Attempt(attempt) => options(LoopStage::Attempt(OF_ORACLE + attempt)),
                answer @ LoopStage::Answer(_) => options(answer),
            };
            let told = explain(&model, 0, &of_oracle, &Silent)?.closed_form();
            let as_given = |name: &str| Some(first.identification.moments(name)?.0);
            let quoted = |name: &str| Some(intervals.get(name)?.mean);
            [distance(&as_given, &told), distance(&quoted, &told)]
        }
    };
    Ok(VerdictReplicate {
        replicate,
        acted: drawn.acted.iter().map(acted).collect(),
        named: conclusion.effects.iter().map(group).collect(),
        status: conclusion.status.words().to_string(),
        held: held(model, drawn, &intervals),
        bias,
    })
}

/// Number of the oracle's first attempt: its chains are not the loop's.
const OF_ORACLE: usize = 50;

/// The model with everything declared that acts. The box of a sampled amplitude reaches a plausible size to both sides.
fn oracle(model: &Model, drawn: &Drawn, averaged: &Keyed<Interval>) -> Model {
    let marginals = model.marginals().into_iter().zip(averaged);
    let wide = marginals.map(|(prior, (name, found))| {
        let interval = Interval {
            mean: prior.mean,
            sd: prior.sd,
            ..*found
        };
        (name.clone(), interval)
    });
    let wide: Keyed<Interval> = wide.collect();
    let mut declared = model.clone();
    for acts in &drawn.acted {
        let sizes = drawn.amplitude(acts).iter();
        let told = Accepted {
            effect: acts.effect,
            amplitude: sizes.map(|a| (*a, 0.0)).collect(),
            law: acts.law,
            plausible: Vec::new(),
        };
        declared = extended(&declared, &told, &wide);
    }
    declared
}

/// Root mean square distance of some constants from those that the oracle quotes, in its sds.
fn distance(of: &dyn Fn(&str) -> Option<f64>, oracle: &Keyed<Interval>) -> f64 {
    let square =
        |(name, told): (&String, &Interval)| Some(((of(name)? - told.mean) / told.sd).powi(2));
    let squares: Vec<f64> = oracle.iter().filter_map(square).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// How often of how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct HowOften {
    pub found: usize,
    pub of: usize,
}

impl HowOften {
    fn new<T>(all: impl IntoIterator<Item = T>, is: impl Fn(&T) -> bool) -> Self {
        let (mut found, mut of) = (0, 0);
        for one in all {
            found += usize::from(is(&one));
            of += 1;
        }
        Self { found, of }
    }

    pub fn share(self) -> f64 {
        self.found as f64 / self.of.max(1) as f64
    }

    /// The 95 % interval of the share (Wilson 1927, J. Am. Stat. Assoc. 22, 209).
    pub fn interval(self) -> [f64; 2] {
        const Z: f64 = 1.959_964;
        let (n, p) = (self.of.max(1) as f64, self.share());
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        [middle - half, middle + half].map(|x| (x / (1.0 + Z * Z / n)).clamp(0.0, 1.0))
    }
}

/// Distance from the oracle, in its sds, from which a bias is counted: a smaller one is no bias to speak of.
const BIASED: f64 = 1.0;

/// How the verdicts fared.
#[derive(Debug, Clone, Serialize)]
pub struct VerdictSummary {
    pub plan: ReplicatePlan,
    pub asked: VerdictPlan,
    pub replicates: usize,
    /// Nulls in which something was named, and in which structure was called unexplained.
    pub named_in_nulls: HowOften,
    pub unexplained_nulls: HowOften,
    /// Measurements with effects that are all named, and no group but theirs.
    pub exact: HowOften,
    /// Effects that acted and were named, alone or in a group: of all, and of those that the measurement would show.
    pub recalled: HowOften,
    pub recalled_of_shown: HowOften,
    /// Effects that acted and were named alone, of all.
    pub recalled_alone: HowOften,
    /// Names and groups in which something acted, of all.
    pub right_groups: HowOften,
    /// Names that stand alone and acted, of all that stand alone.
    pub right_alone: HowOften,
    /// Measurements that end explained, with a name in whose group nothing acts.
    pub sure_and_wrong: HowOften,
    /// 95 % intervals that hold their constant.
    pub held: HowOften,
    /// Explained measurements whose effects moved the constants by more than one sd of the oracle.
    pub biased: usize,
    /// Median over those of the distance from the oracle after closing over that before.
    pub bias_left: f64,
}

impl VerdictSummary {
    pub fn new(plan: &ReplicatePlan, asked: VerdictPlan, all: &[VerdictReplicate]) -> Self {
        let nulls = || all.iter().filter(|r| r.is_null());
        let acted = || all.iter().filter(|r| !r.is_null());
        let effects = || all.iter().flat_map(|r| r.acted.iter().map(move |a| (r, a)));
        let named = |(r, a): &(&VerdictReplicate, &ActedEffect)| r.names(&a.effect);
        let named_alone =
            |(r, a): &(&VerdictReplicate, &ActedEffect)| r.alone().any(|name| *name == a.effect);
        let alone = all.iter().flat_map(|r| r.alone().map(|name| r.acts(name)));
        let groups = all.iter().map(|r| (r.false_names(), r.named.len()));
        let (wrong, of) = groups.fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
        let closed = acted().filter(|r| r.is_explained() && r.bias[0] > BIASED);
        let left: Vec<f64> = closed.map(|r| r.bias[1] / r.bias[0]).collect();
        Self {
            plan: plan.clone(),
            asked,
            replicates: all.len(),
            named_in_nulls: HowOften::new(nulls(), |r| !r.named.is_empty()),
            unexplained_nulls: HowOften::new(nulls(), |r| !r.is_explained()),
            exact: HowOften::new(acted(), |r| r.is_exact()),
            recalled: HowOften::new(effects(), named),
            recalled_of_shown: HowOften::new(effects().filter(|(_, a)| a.shows), named),
            recalled_alone: HowOften::new(effects(), named_alone),
            right_alone: HowOften::new(alone, |acts| *acts),
            right_groups: HowOften {
                found: of - wrong,
                of,
            },
            sure_and_wrong: HowOften::new(all, |r| r.is_explained() && r.false_names() > 0),
            held: HowOften::new(all.iter().flat_map(|r| &r.held), |held| **held),
            biased: left.len(),
            bias_left: quantile(&sorted(&left), 0.5),
        }
    }

    /// F1 of the names, where "A or B" names both, and where only a name that stands alone counts.
    pub fn f1(&self) -> [f64; 2] {
        [
            harmonic(self.right_groups, self.recalled),
            harmonic(self.right_alone, self.recalled_alone),
        ]
    }
}

/// Harmonic mean of the share of names that are right and of the share of effects that are named.
fn harmonic(right: HowOften, recalled: HowOften) -> f64 {
    let (precision, recall) = (right.share(), recalled.share());
    match precision + recall > 0.0 {
        true => 2.0 * precision * recall / (precision + recall),
        false => f64::NAN,
    }
}
