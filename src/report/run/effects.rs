//! What the residual was traced to, what could hide in it, and the intervals to quote.

use indexmap::IndexMap;

use super::rounds::names;
use crate::parameter::Parameter;
use crate::report::document::{Closing, Report};
use crate::report::json::Keyed;
use crate::report::learned::{self, Learned};
use crate::report::page::Page;
use crate::report::round::{MeanAndSd, RoundReport};
use crate::report::sources;
use crate::report::tracing::{AliasGroupReport, CandidateReport, TracingReport};
use crate::report::words::{ALIKE, LINEAR, PROBABLE, beyond_the_dictionary, widening};
use crate::section::{Digits, Piece, Section, Table, TableCell, row};
use crate::trace::{BlindSpot, Interval, LINEAR_PERCENT, Suspect};

/// Effects that a terminal lists.
const LISTED: usize = 8;

/// What a residual was traced to, for a terminal.
pub fn tracing(tracing: &TracingReport) -> Section {
    let listed = &tracing.candidates[..tracing.candidates.len().min(LISTED)];
    Section::new("effects that the residual was traced to")
        .with(candidates(listed))
        .with(Piece::list(tracing.groups.iter().map(group)))
        .say(discrepancy(tracing).unwrap_or_default())
}

/// The effects weighed against the residual of every round.
pub fn ranking(page: &Page) -> Section {
    let mut section = Section::new("Effects");
    let rounds = page.report.rounds.iter().zip(names(page));
    for (round, name) in rounds {
        let Some(tracing) = round.tracing.as_ref().filter(|t| !t.candidates.is_empty()) else {
            continue;
        };
        let all = &tracing.candidates;
        let is_shown = |c: &CandidateReport| c.inclusion_probability >= NAUGHT;
        let (shown, naught): (Vec<_>, Vec<_>) = all.iter().cloned().partition(is_shown);
        let accepted = match tracing.accepted.is_empty() {
            true => "No effect was accepted.".into(),
            false => format!("Accepted: {}.", tracing.accepted.join(", ")),
        };
        let mut left: IndexMap<&str, Vec<&str>> = IndexMap::new();
        for out in &tracing.left_out {
            left.entry(&out.reason).or_default().push(&out.effect);
        }
        let left = left.iter();
        let left: Vec<String> = left
            .map(|(why, effects)| format!("{}: {why}", effects.join(", ")))
            .collect();
        section = section
            .with(Piece::Heading(format!(
                "Effects weighed against the residual: {name}"
            )))
            .say(format!(
                "{accepted} {}",
                discrepancy(tracing).unwrap_or_default()
            ))
            .with(candidates(&shown))
            .say(improbable(&naught));
        if !left.is_empty() {
            section.push(Piece::Note("Not weighed, and why:".into()));
            section.push(Piece::list(left));
        }
    }
    section
}

/// Effects of a smaller probability are one line: with three decimals it is 0.
const NAUGHT: f64 = 5e-4;

/// Effects that are as good as excluded, in a sentence.
fn improbable(candidates: &[CandidateReport]) -> String {
    let names: Vec<String> = candidates.iter().map(CandidateReport::name).collect();
    match names.is_empty() {
        true => String::new(),
        false => format!("Probability 0.000: {}.", names.join(", ")),
    }
}

fn discrepancy(tracing: &TracingReport) -> Option<String> {
    let p = tracing.discrepancy_probability;
    p.is_finite()
        .then(|| format!("Probability of smooth structure that no effect explains: {p:.3}."))
}

fn candidates(candidates: &[CandidateReport]) -> Table {
    let header = [
        "effect",
        "probability",
        "log Bayes factor",
        "amplitude",
        "alone explains",
        "detectable from",
        "resembles (cosine)",
    ];
    let caption = "probability that each effect acts, its amplitude if it does, and what could stand in for it";
    Table::new(caption, header, candidates.iter().map(candidate)).sortable()
}

/// Aliases in the table, at most.
const SHOWN: usize = 3;

fn candidate(found: &CandidateReport) -> Vec<TableCell> {
    let mut amplitude: Vec<TableCell> = found
        .amplitude
        .iter()
        .map(|a| TableCell::MeanSd {
            mean: a.mean,
            sd: a.sd,
            unit: Parameter::read(&a.parameter).unit(),
        })
        .collect();
    if found.implausible {
        amplitude.push("implausibly large".into());
    }
    let aliases = found.aliases.iter().filter(|a| a.cosine >= ALIKE);
    let mut aliases: Vec<String> = aliases
        .map(|a| format!("{} ({})", a.name(), Digits::Three.write(a.cosine)))
        .collect();
    let more = aliases.len().saturating_sub(SHOWN);
    if more > 0 {
        aliases.truncate(SHOWN);
        aliases.push(format!("{more} more in report.json"));
    }
    let p = found.inclusion_probability;
    let explained = Some(found.explained_fraction).filter(|_| p >= PROBABLE);
    let cells = [
        TableCell::Probability(p),
        TableCell::fixed(found.log_bayes_factor, 1),
        TableCell::Several(amplitude),
        TableCell::with_unit(explained.map(|f| 100.0 * f), Digits::Fixed(0), "%"),
        TableCell::or_never(found.detectable),
        aliases.join(", ").into(),
    ];
    row(found.name(), cells)
}

/// What is said of effects that stand in for each other.
fn group(g: &AliasGroupReport) -> String {
    let better = match g.predicts_held_out_blocks {
        true => "better",
        false => "no better",
    };
    let pairs = g.pairs.iter();
    let pairs = pairs.map(|[a, b]| format!("; {a} with {b} could stand in for it"));
    format!(
        "{}: probability {:.3}, log evidence lost without it {:.0}, held-out blocks are predicted {better} with it{}",
        g.members.join(" or "),
        g.probability,
        Some(g.log_evidence_lost_without)
            .filter(|lost| lost.is_finite())
            .unwrap_or(f64::INFINITY),
        pairs.collect::<String>()
    )
}

/// What each effect would do at its plausible size if it acted and the model lacked it.
pub fn blind_spots(spots: &[BlindSpot], constants: &[&str]) -> Section {
    let header = [
        "effect",
        "plausible size",
        "detectable from",
        "would be seen",
    ];
    let header = header.into_iter().map(String::from);
    let header = header.chain(constants.iter().map(|c| format!("{c}, %")));
    let rows = spots.iter().map(|spot| {
        let seen = TableCell::Mark {
            yes: spot.would_be_seen,
            matters: true,
        };
        let size = format!("{} {}", Digits::Three.write(spot.plausible), spot.unit);
        let cells = [
            size.trim_end().into(),
            TableCell::or_never(spot.detectable),
            seen,
        ];
        let shift = |c: &&str| TableCell::number(spot.shift(c), Digits::Limited(LINEAR_PERCENT));
        row(
            spot.name(),
            cells.into_iter().chain(constants.iter().map(shift)),
        )
    });
    let caption = "what each effect would do to the constants at its plausible size, in %, if the model lacked it, and whether it would be seen";
    Section::new("Blind spots")
        .say("An effect that these data would not show can still move the constants. The averaged posterior counts it; the posterior of a single model does not.")
        .with(Table::new(caption, header, rows).sortable())
        .say(beyond_the_dictionary())
        .say(LINEAR)
}

/// The constants to quote beside those of the model alone, with the answers that they span where the account is suspect.
fn quoted(
    quoted: &Keyed<Interval>,
    suspect: Option<&Suspect>,
    alone: &Keyed<MeanAndSd>,
    learned: &Keyed<Learned>,
) -> Section {
    let title = match suspect {
        Some(_) => {
            "constants: the intervals to quote span all answers, because the account is not unique"
        }
        None => "constants averaged over what may act unseen: the intervals to quote",
    };
    let rows = quoted.iter().map(|(name, a)| {
        let numbers = TableCell::as_precise_as(a.sd, [a.mean, a.sd, a.low, a.median, a.high]);
        let alone = alone.get(name).copied();
        let prior = Learned::cells(learned.get(name));
        let cells = numbers.into_iter().chain(prior);
        row(name, cells.chain([TableCell::mean_sd(alone)]))
    });
    let [prior, data] = learned::HEADERS;
    let header = [
        "",
        "mean",
        "sd",
        "2.5 %",
        "median",
        "97.5 %",
        prior,
        data,
        "model alone",
    ];
    let section = Section::new(title).with(Table::new("", header, rows));
    section.with_all(suspect.map(answers).into_iter().flatten())
}

/// What could hide in a residual that was traced, and the constants to quote.
pub fn averaged(
    tracing: &TracingReport,
    to_quote: &Keyed<Interval>,
    suspect: Option<&Suspect>,
    spots: &[BlindSpot],
    (alone, learned): (&Keyed<MeanAndSd>, &Keyed<Learned>),
) -> [Section; 2] {
    let names: Vec<&str> = to_quote.keys().map(String::as_str).collect();
    let mut section = quoted(to_quote, suspect, alone, learned);
    if suspect.is_none() {
        section = section.say(widening((alone, to_quote), tracing, spots).unwrap_or_default());
    }
    [blind_spots(spots, &names), section]
}

/// The constants by each answer.
fn answers(suspect: &Suspect) -> Vec<Piece> {
    let names: Vec<&String> = suspect
        .answers
        .iter()
        .take(1)
        .flat_map(|a| a.constants.keys())
        .collect();
    let letters = || suspect.answers.iter().zip('A'..);
    let rows = letters().map(|(answer, letter)| {
        let constant = |name: &&String| {
            TableCell::mean_sd(answer.constants.get(*name).map(|i| (i.mean, i.sd)))
        };
        row(letter.to_string(), names.iter().map(constant))
    });
    let header = std::iter::once("").chain(names.iter().map(|n| n.as_str()));
    let supposing = letters().map(|(a, letter)| (letter.to_string(), a.supposing.to_string()));
    let why = suspect.reasons.join("; ");
    vec![
        Piece::Paragraph(format!("The account of the residual is not unique: {why}.")),
        Table::new("constants by each answer: mean +- sd", header, rows).into(),
        Piece::List(supposing.collect()),
    ]
}

/// The constants to quote of a loop, with what there is to say beside them.
pub fn to_quote(report: &Report, closing: &Closing, last: &RoundReport) -> Section {
    let suspect = closing.verdict.suspect.as_ref();
    let (averaged, alone) = (&closing.averaged_posterior, last.alone());
    quoted(averaged, suspect, &alone, &report.learned).with_all(remarks(closing))
}

/// What there is to say beside the intervals to quote.
fn remarks(closing: &Closing) -> Vec<Piece> {
    let note = closing.averaged_note.clone();
    let note = note.filter(|_| closing.verdict.suspect.is_none());
    let sampled = closing.quoted.as_ref();
    let widths = sampled.map(|q| sources::pieces(&q.sources));
    note.into_iter()
        .chain(sampled.map(|q| q.words()))
        .map(Piece::Paragraph)
        .chain(widths.into_iter().flatten())
        .collect()
}
