//! How a loop ended, in words: which effects the residual is consistent with, what is left, and what would confirm it.

use serde::{Deserialize, Serialize};

use super::axis;
use super::facts::{Status, VerdictFacts};
use super::patches::Patches;
use super::round::Round;
use super::suspect::Suspect;
use super::together::both_alone;
use super::tracing::{Named, Resembling};
use super::vetoes::vetoes;
use crate::effect::{Effect, amplitude_name, find};
use crate::files::Keyed;
use crate::identify::Patterns;
use crate::parameter::Parameter;
use crate::quantity::{plus_minus, significant};

/// What the loop concludes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conclusion {
    pub status: Status,
    /// Effects added, in order.
    #[serde(default)]
    pub effects: Vec<String>,
    /// The same, each with those that the evidence does not tell from it, where there are some.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_told_apart: Vec<Vec<String>>,
    /// Pairs of other effects that explain together what an added one does, by its name.
    #[serde(default, skip_serializing_if = "Keyed::is_empty")]
    pub pairs_instead: Keyed<Vec<[String; 2]>>,
    /// What the sizes of added effects mean for the fields or the constants, where that is not plain: a sentence an effect.
    #[serde(default, skip_serializing_if = "Keyed::is_empty")]
    pub meanings: Keyed<String>,
    /// Effects that leave the same field as an added one, or almost: those that the evidence does not tell from it, and those of a cosine
    /// above 0.95.
    #[serde(default)]
    pub alias_groups: Vec<Vec<String>>,
    /// What the members of the groups beside the added effects would need to stand in for them.
    #[serde(default)]
    pub alias_sizes: Vec<AliasSize>,
    /// What forbids a verdict of `closed` or `nothing_missing`.
    #[serde(default)]
    pub vetoes: Vec<String>,
    /// Why the account of the residual is not unique, and the answers that the quoted intervals span then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suspect: Option<Suspect>,
    /// Groups that the data speak for without being sure.
    #[serde(default)]
    pub undecided: Vec<Vec<String>>,
    pub text: String,
    /// Places where the residual is not noise.
    #[serde(default, skip_serializing_if = "Patches::is_empty")]
    pub patches: Patches,
    /// What would confirm each effect named, and tell it from its stand-ins.
    #[serde(default)]
    pub confirm: Vec<Confirming>,
}

impl Conclusion {
    /// The verdict as people read it.
    pub fn words(&self) -> String {
        match self.status {
            Status::NothingMissing => "explained by noise alone".into(),
            Status::Closed => {
                let names: Vec<String> = self.effects.iter().map(|e| self.name(e)).collect();
                format!("explained by: {}", names.join(", "))
            }
            Status::Unexplained => "not explained".into(),
        }
    }

    /// An added effect, with those that the evidence does not tell from it.
    pub fn name(&self, effect: &String) -> String {
        let mut groups = self.not_told_apart.iter();
        let group = groups.find(|group| group.first() == Some(effect));
        let alone = group.map_or_else(|| effect.clone(), |group| group.join(" or "));
        let pairs = self.pairs_instead.get(effect);
        pairs.map_or_else(|| alone.clone(), |p| format!("{alone} or {}", together(p)))
    }
}

/// Pairs in words, by the effect that they share where there is one.
pub fn together(pairs: &[[String; 2]]) -> String {
    let all = pairs.iter().flatten();
    let shared = all.clone().find(|a| pairs.iter().all(|p| p.contains(a)));
    match shared {
        Some(shared) => {
            let others: Vec<&str> = all.filter(|a| *a != shared).map(String::as_str).collect();
            match others.len() {
                ..=2 => format!("{shared} with {}", others.join(" or ")),
                more => format!("{shared} with one of {more} others"),
            }
        }
        None => format!("one of {} pairs of others", pairs.len()),
    }
}

/// The size that an effect would need to leave almost the field of another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AliasSize {
    pub effect: String,
    /// Whose field it would leave.
    pub instead_of: String,
    /// Cosine of the two fields.
    pub cosine: f64,
    /// Amplitudes, border units.
    pub amplitude: Keyed<f64>,
    /// The largest of them over its prior sd.
    pub plausible_multiple: f64,
}

/// The tests that would tell the members of a group apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Confirming {
    /// Whether the group's leader is part of the last model.
    pub added: bool,
    /// Of the leader, of what could stand in for it alone or in a pair, and of what leaves almost the same field.
    pub tests: Vec<ConfirmingTest>,
}

/// A test in the laboratory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfirmingTest {
    pub effect: String,
    pub test: String,
}

impl Confirming {
    /// What the tests would show.
    pub fn question(&self) -> String {
        let leader = self.tests.first().map_or("", |t| &t.effect);
        if self.tests.len() > 1 {
            format!("What would tell {leader} from what could stand in for it")
        } else {
            format!("What would confirm {leader}")
        }
    }
}

/// What no field shows, and no verdict therefore speaks of.
pub const FORCE_UNSEEN: &str = "A force, a thickness or a width that is wrong by 1 % makes all moduli wrong by 1 % or more, and no field shows it.";

/// Names as the report keeps them.
pub fn texts(names: &[&str]) -> Vec<String> {
    names.iter().map(|n| (*n).to_string()).collect()
}

/// The conclusion of all rounds; `refused` are effects that were added and taken out again, with the reason.
pub fn conclude(rounds: &[Round], refused: &[(&'static str, String)]) -> Conclusion {
    let last = &rounds[rounds.len() - 1];
    let mut groups: Vec<&Named> = rounds.iter().filter_map(accepted).collect();
    // the last round's is called for, but there was no round to add it
    let wanted = accepted(last).and_then(|_| groups.pop());
    let structure = last.tracing.leaves_structure();
    let patterns = last.patterns().any();
    let vetoes = vetoes(rounds);
    let mut suspect = rounds[0].tracing.suspect.beside(&last.tracing.suspect);
    suspect.reasons.extend(vetoes.iter().cloned());
    suspect.answers.extend(both_alone(last));
    let suspect = (!suspect.reasons.is_empty()).then_some(suspect);
    let facts = VerdictFacts {
        added: !groups.is_empty(),
        wanted: wanted.is_some(),
        structure,
        patterns,
        undecided: !last.tracing.undecided.is_empty(),
        objections: suspect.is_some() || !vetoes.is_empty(),
    };
    let status = facts.status();
    let mut confirm: Vec<Confirming> = groups.iter().map(|g| confirming(g, true)).collect();
    confirm.extend(wanted.map(|g| confirming(g, false)));
    for members in &last.tracing.undecided {
        let group = last.tracing.groups.iter().find(|g| g.members == *members);
        let is_named = |c: &Confirming| c.tests.iter().any(|t| t.effect == members[0]);
        if !confirm.iter().any(is_named) {
            // what was refused for good has no group any more
            confirm.push(group.map_or_else(|| tests(members, false), |g| confirming(g, false)));
        }
    }
    Conclusion {
        status,
        effects: groups.iter().map(|g| g.leader.into()).collect(),
        not_told_apart: groups
            .iter()
            .filter(|g| g.members.len() > 1)
            .map(|g| texts(&led(g)))
            .collect(),
        pairs_instead: groups
            .iter()
            .filter(|g| !g.pairs.is_empty())
            .map(|g| {
                (
                    g.leader.into(),
                    g.pairs.iter().map(|p| p.map(String::from)).collect(),
                )
            })
            .collect(),
        meanings: groups
            .iter()
            .filter_map(|g| Some((g.leader.into(), meaning(rounds, g.leader)?)))
            .collect(),
        alias_groups: groups
            .iter()
            .map(|g| alike(g))
            .filter(|g| g.len() > 1)
            .collect(),
        alias_sizes: groups.iter().flat_map(|g| alias_sizes(g)).collect(),
        undecided: last.tracing.undecided.iter().map(|g| texts(g)).collect(),
        patches: last.patches().clone(),
        text: words(rounds, &groups, wanted, facts)
            + &last.noise_and_patches()
            + &axis::words(&last.model)
            + &objections(status, &vetoes, suspect.as_ref())
            + &taken_out(refused),
        vetoes,
        suspect: suspect.clone(),
        confirm,
    }
}

/// An effect, and what the evidence does not tell from it.
fn led(group: &Named) -> Vec<&'static str> {
    let others = group.members.iter().filter(|m| **m != group.leader);
    std::iter::once(&group.leader)
        .chain(others)
        .copied()
        .collect()
}

/// An effect, what the evidence does not tell from it, and what leaves almost the same field.
fn alike(group: &Named) -> Vec<String> {
    let mut names = texts(&group.members);
    for other in same_field(group) {
        if !group.members.contains(&other.effect) {
            names.push(other.effect.into());
        }
    }
    names
}

/// What the others would need to leave the field of a group's leader.
fn alias_sizes(group: &Named) -> Vec<AliasSize> {
    let size = |r: &Resembling| AliasSize {
        effect: r.effect.into(),
        instead_of: group.leader.into(),
        cosine: r.cosine,
        amplitude: r.amplitude.iter().cloned().collect(),
        plausible_multiple: r.multiple,
    };
    group
        .resembling
        .iter()
        .filter(|r| r.cosine > NEARLY_THE_SAME || group.members.contains(&r.effect))
        .map(size)
        .collect()
}

/// What stands against a verdict, as sentences.
fn objections(status: Status, vetoes: &[String], suspect: Option<&Suspect>) -> String {
    let mut text = String::new();
    if let (Status::Unexplained, false) = (status, vetoes.is_empty()) {
        text += &format!(" Not closed, because {}.", vetoes.join("; "));
    }
    if let Some(suspect) = suspect {
        // what forbids the verdict has been said
        let others = suspect.reasons.iter().filter(|r| !vetoes.contains(r));
        let others: Vec<&str> = others.map(String::as_str).collect();
        if !others.is_empty() {
            text += &format!(" The account is not unique: {}.", others.join("; "));
        }
        text += &format!(
            " The intervals to quote span {} answers.",
            suspect.answers.len()
        );
    }
    text
}

/// What was added and taken out again, as sentences.
fn taken_out(refused: &[(&'static str, String)]) -> String {
    let said = refused
        .iter()
        .map(|(effect, why)| format!(" {effect} was added and taken out again: {why}."));
    said.collect()
}

/// The group of the effect that a round's tracing accepted.
fn accepted(round: &Round) -> Option<&Named> {
    let effect = round.tracing.accepted.as_ref()?.effect;
    let groups = &round.tracing.groups;
    groups.iter().find(|g| g.leader == effect.name())
}

fn effect(name: &str) -> Option<&'static dyn Effect> {
    find("conclusion", name).ok()
}

fn confirming(group: &Named, added: bool) -> Confirming {
    let mut names = vec![group.leader];
    let pairs = group.pairs.iter().flatten();
    let resembling = resembling(group).map(|r| &r.effect);
    for name in group.members.iter().chain(pairs).chain(resembling) {
        if !names.contains(name) {
            names.push(name);
        }
    }
    tests(&names, added)
}

fn tests(names: &[&str], added: bool) -> Confirming {
    let test = |name: &&str| {
        Some(ConfirmingTest {
            effect: (*name).into(),
            test: effect(name)?.entry().confirm.into(),
        })
    };
    Confirming {
        added,
        tests: names.iter().filter_map(test).collect(),
    }
}

/// The amplitudes (mean, sd) of an effect by the last round, or by the tracing that called for it, with their parameters' names.
fn amplitudes(rounds: &[Round], name: &str) -> Vec<(&'static str, f64, f64)> {
    let Some(effect) = effect(name) else {
        return Vec::new();
    };
    let last = &rounds[rounds.len() - 1].identification;
    let mut called_for = rounds.iter().filter_map(|r| r.tracing.accepted.as_ref());
    let traced = called_for.find(|a| a.effect.name() == name);
    let traced = traced.map_or(&[][..], |a| &a.amplitude);
    let parameters = effect.parameters().iter().enumerate();
    let values = parameters.filter_map(|(k, p)| {
        let (mean, sd) = last
            .moments(&amplitude_name(effect, p))
            .or_else(|| traced.get(k).copied())?;
        Some((p.name, mean, sd))
    });
    values.collect()
}

/// The same in words.
fn amplitude(rounds: &[Round], name: &str) -> String {
    let alone = effect(name).is_some_and(|e| e.parameters().len() == 1);
    let values = amplitudes(rounds, name).into_iter().map(|(own, mean, sd)| {
        let value = plus_minus(mean, sd);
        match alone {
            true => format!("{value} {}", Parameter::read(own).unit()),
            false => format!("{own} {value}"),
        }
    });
    values.collect::<Vec<_>>().join(", ")
}

/// What the size of an added effect means, in a sentence without its stop.
fn meaning(rounds: &[Round], name: &str) -> Option<String> {
    let found = amplitudes(rounds, name).into_iter();
    let found: Vec<[f64; 2]> = found.map(|(_, mean, sd)| [mean, sd]).collect();
    let of = effect(name).filter(|e| e.parameters().len() == found.len())?;
    of.meaning(&found, &rounds[rounds.len() - 1].model.scene())
}

/// An effect with its amplitude, and what could stand in for it.
fn consistent(rounds: &[Round], group: &Named) -> String {
    let mut text = group.leader.to_string();
    let laws: Vec<&str> = group.laws.iter().map(|law| law.words()).collect();
    if !laws.is_empty() {
        text += &format!(", {}", laws.join(" or "));
    }
    let amplitude = amplitude(rounds, group.leader);
    if !amplitude.is_empty() {
        text += &format!(" ({amplitude})");
    }
    let others = &led(group)[1..];
    if !others.is_empty() {
        text += &format!(
            ", or with {}, which this measurement cannot tell from it",
            others.join(" or ")
        );
    }
    for (k, other) in resembling(group).enumerate() {
        let begin = if k == 0 {
            ". Almost the same field"
        } else {
            ", or"
        };
        text += &format!(
            "{begin} (cosine {:.3}) would come from {} with {}, {:.1} times its plausible size",
            other.cosine,
            other.effect,
            size_of(&other.amplitude),
            other.multiple
        );
    }
    if resembling(group).next().is_some() {
        let large = resembling(group).any(|r| r.multiple > 1.0);
        text += if large {
            ". Only the finer shape of the field and the size that it would need speak against it. Make the tests below"
        } else {
            ". Only the finer shape of the field speaks against it. Make the tests below"
        };
    }
    text
}

/// Amplitudes in words, without those that are nothing beside the largest.
pub fn size_of(amplitude: &[(String, f64)]) -> String {
    let largest = amplitude.iter().fold(0.0, |m: f64, (_, v)| m.max(v.abs()));
    let kept = amplitude.iter().filter(|(_, v)| v.abs() > 1e-3 * largest);
    let with_value = |(name, value): &(String, f64)| {
        let parameter = Parameter::read(name).own;
        if value.abs() < 1e-3 {
            format!("{parameter} {value:.2e}")
        } else {
            format!("{parameter} {}", significant(*value, 0.1 * value.abs()))
        }
    };
    kept.map(with_value).collect::<Vec<_>>().join(", ")
}

/// Resembling effects that are named in words, at most.
const WORTH_NAMING: usize = 2;

/// Cosine from which fields differ by less than what a model of a real specimen may have wrong: uniform out-of-plane bending was named
/// uniform strain at a cosine of 0.995 (measured on the program as built).
const NEARLY_THE_SAME: f64 = 0.95;

/// An effect that would need a larger multiple of its plausible size explains nothing.
const ABSURD: f64 = 20.0;

/// The effects that leave almost the same field as a group's leader, at a size that can be.
fn same_field(group: &Named) -> impl Iterator<Item = &Resembling> {
    let can_be = |r: &&Resembling| r.cosine > NEARLY_THE_SAME && r.multiple < ABSURD;
    group.resembling.iter().filter(can_be)
}

/// Those of them outside the group that are named in words.
fn resembling(group: &Named) -> impl Iterator<Item = &Resembling> {
    let outside = |r: &&Resembling| !group.members.contains(&r.effect);
    same_field(group).filter(outside).take(WORTH_NAMING)
}

fn words(
    rounds: &[Round],
    added: &[&Named],
    wanted: Option<&Named>,
    facts: VerdictFacts,
) -> String {
    let mut said: Vec<String> = Vec::new();
    for group in added {
        let begin = if said.is_empty() {
            "The residual is consistent with"
        } else {
            "With that in the model it is consistent with"
        };
        said.push(format!("{begin} {}.", consistent(rounds, group)));
        said.extend(meaning(rounds, group.leader).map(|s| s + "."));
    }
    if let Some(group) = wanted {
        said.push(format!(
            "{} with {}; the limit of rounds or of time kept it out of the model, and the constants lack what it does to them.",
            if said.is_empty() { "The residual is consistent" } else { "What is left is consistent" },
            consistent(rounds, group)
        ));
    }
    let patterns = pattern_words(&rounds[rounds.len() - 1], facts.structure);
    let has_patches = rounds[rounds.len() - 1].patches().found().next().is_some();
    let only_there = has_patches && !(facts.wanted || facts.structure || facts.patterns);
    let misfit = &rounds[rounds.len() - 1].identification.misfit;
    let with_undecided = misfit.with_undecided && facts.status() == Status::Closed;
    let whole = match (only_there, with_undecided) {
        (true, _) => Some(
            "As a whole the residual is what the measured noise explains, but not in one place.",
        ),
        (false, true) => Some(
            "Noise alone does not explain what is left. Noise and an effect that is undecided do.",
        ),
        (false, false) => facts.words(),
    };
    said.extend(whole.map(String::from));
    // what an effect makes that was not added is no pattern of its own
    said.extend(patterns.into_iter().filter(|_| wanted.is_none()));
    let undecided = &rounds[rounds.len() - 1].tracing.undecided;
    said.push(FORCE_UNSEEN.into());
    said.extend(rounds[rounds.len() - 1].tracing.leaning.iter().cloned());
    if !undecided.is_empty() {
        let names: Vec<String> = undecided.iter().map(|g| g.join(" or ")).collect();
        said.push(format!("Undecided: {}.", names.join("; ")));
    }
    said.join(" ")
}

/// A sentence about what stationary noise does not do.
fn pattern_words(round: &Round, structure: bool) -> Option<String> {
    let Patterns { exceedance } = round.patterns();
    let size_mm = round.identification.inverse.noise.blocks.size_mm;
    let place = |[x, y]: [f64; 2]| format!("({x:.1}, {y:.1}) mm of the data");
    exceedance.map(|b| {
        let begin = format!(
            "In {} the residual is larger than uniform noise in places: {} of {} averages over {:.2} mm are beyond 4 sd ({:.1} expected)",
            b.component, b.blocks, b.of, size_mm, b.expected
        );
        if b.blocks > b.of / 10 {
            return format!("{begin}, all over the field: the model as it is does not describe it.");
        }
        format!(
            "{begin}, the farthest {:.0} sd, at {}. That is an edge, a patch of bad data or a local defect{}; look at the residual's map there, and mask what is the data's fault, or explain it.",
            b.sds,
            place(b.place_in_data_mm),
            if structure { ", or a peak of the structure that is left" } else { "" }
        )
    })
}
