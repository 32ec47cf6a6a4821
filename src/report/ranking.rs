//! What tracing and the loop say on the terminal.

use std::fmt::Write;
use std::iter::once;

use super::document::Closing;
use super::json::Keyed;
use super::page::Page;
use super::round::{MeanAndSd, RoundReport};
use super::steps;
use super::terminal::{mean_sd, table, wrap};
use super::tracing::{BlindSpotReport, CandidateReport, TracingReport};
use super::words::{
    ALIKE, LINEAR, LINEAR_PERCENT, PROBABLE, beyond_the_dictionary, contradiction, shift, unit,
    widening,
};
use crate::quantity::{plus_minus, significant, three_digits};
use crate::trace::{Confirming, Interval, Status, Suspect};

/// Effects listed below the accepted ones.
const LISTED: usize = 8;

/// The ranking of effects, what stands in for what, the averaged posterior and the blind spots.
pub fn tracing(tracing: &TracingReport) -> String {
    let mut text = String::from("\neffects that the residual was traced to\n\n");
    let rows = tracing.candidates.iter().take(LISTED).map(row);
    let header = [
        "effect",
        "probability",
        "log Bayes factor",
        "amplitude",
        "alone explains %",
        "resembles (cosine)",
    ];
    text += &table(&header, rows);
    for g in &tracing.groups {
        let _ = write!(
            text,
            "\n{}: probability {:.3}, log evidence lost without it {:.0}, held-out blocks are predicted {} with it",
            g.members.join(" or "),
            g.probability,
            g.log_evidence_lost_without.unwrap_or(f64::INFINITY),
            if g.predicts_held_out_blocks {
                "better"
            } else {
                "no better"
            }
        );
        for [a, b] in &g.pairs {
            let _ = write!(text, "; {a} with {b} could stand in for it");
        }
    }
    let _ = writeln!(
        text,
        "\nprobability of smooth structure that no effect explains: {:.3}",
        tracing.discrepancy_probability.unwrap_or(f64::NAN)
    );
    text
}

fn row(found: &CandidateReport) -> Vec<String> {
    let amplitude = found.amplitude.iter();
    let amplitude =
        amplitude.map(|a| format!("{} {}", plus_minus(a.mean, a.sd), unit(&a.parameter)));
    let flag = if found.implausible {
        " (implausibly large)"
    } else {
        ""
    };
    let explains = found
        .explained_fraction
        .filter(|_| found.inclusion_probability >= PROBABLE);
    let alike = found.aliases.iter().filter(|a| a.cosine >= ALIKE).take(3);
    vec![
        found.name(),
        format!("{:.3}", found.inclusion_probability),
        found
            .log_bayes_factor
            .map_or("-".into(), |f| format!("{f:.1}")),
        amplitude.collect::<Vec<_>>().join(", ") + flag,
        explains.map_or("-".into(), |f| format!("{:.0}", 100.0 * f)),
        alike
            .map(|a| format!("{} {:.2}", a.name(), a.cosine))
            .collect::<Vec<_>>()
            .join(", "),
    ]
}

/// What could hide in the residual, and the `quoted` constants beside those of the model `alone`, with the answers that they span
/// where the account is suspect.
pub fn averaged(
    tracing: &TracingReport,
    quoted: &Keyed<Interval>,
    suspect: Option<&Suspect>,
    spots: &[BlindSpotReport],
    alone: &Keyed<MeanAndSd>,
) -> String {
    let names: Vec<&str> = quoted.keys().map(String::as_str).collect();
    let mut text = blind_spots(spots, &names);
    text += match suspect {
        Some(_) => {
            "\nconstants: the intervals to quote span three answers, because the account is not unique\n\n"
        }
        None => "\nconstants averaged over what may act unseen: the intervals to quote\n\n",
    };
    let rows = quoted.iter().map(|(name, a)| {
        let bare = alone.get(name).map(|m| plus_minus(m.mean, m.sd));
        once(name.clone())
            .chain([a.mean, a.sd, a.low, a.high].map(|v| significant(v, a.sd)))
            .chain([bare.unwrap_or("-".into())])
            .collect()
    });
    let header = ["", "mean", "sd", "2.5 %", "97.5 %", "model alone"];
    text += &table(&header, rows);
    if let Some(suspect) = suspect {
        text += &answers(suspect);
    } else if let Some(note) = widening(alone, tracing, spots) {
        text += "\n";
        text += &wrap("  ", "  ", &note);
    }
    text
}

/// The constants by each answer.
fn answers(suspect: &Suspect) -> String {
    let names: Vec<&String> = suspect
        .answers
        .iter()
        .take(1)
        .flat_map(|a| a.constants.keys())
        .collect();
    let header: Vec<&str> = once("").chain(names.iter().map(|n| n.as_str())).collect();
    let letters = suspect.answers.iter().zip('A'..);
    let rows = letters.clone().map(|(answer, letter)| {
        let cell = |name: &&String| {
            answer
                .constants
                .get(name.as_str())
                .map_or("-".into(), |i| plus_minus(i.mean, i.sd))
        };
        once(letter.to_string())
            .chain(names.iter().map(cell))
            .collect()
    });
    let mut text = format!("\n{}", table(&header, rows));
    for (answer, letter) in letters {
        text += &wrap("  ", "    ", &format!("{letter}: {}", answer.supposing));
    }
    text
}

fn blind_spots(spots: &[BlindSpotReport], constants: &[&str]) -> String {
    let mut text = String::from(
        "\nblind spots: what one plausible amplitude would do to the constants, in %, and whether it would have been seen\n\n",
    );
    let header = [&["", "plausible"], constants, &["detectable from", "seen"]].concat();
    let rows = spots.iter().map(|spot| {
        let shifts = constants.iter().map(|c| spot.shift(c));
        once(spot.name())
            .chain([three_digits(spot.plausible)])
            .chain(shifts.map(|s| s.map_or("-".into(), |s| shift(s, 2))))
            .chain([spot.detectable.map_or("never".into(), three_digits)])
            .chain([if spot.would_be_seen { "yes" } else { "NO" }.into()])
            .collect()
    });
    text += &table(&header, rows);
    text += "\n";
    text += &wrap("  ", "  ", &beyond_the_dictionary());
    let mut shifts = spots.iter().flat_map(|s| s.shift_in_percent.values());
    if shifts.any(|s| s.is_none_or(|s| s.abs() > LINEAR_PERCENT)) {
        text += "\n";
        text += &wrap("  ", "  ", LINEAR);
    }
    text
}

/// What the first and the last round leave of every step of a series, and whether it is linear in the load.
fn of_steps(rounds: &[RoundReport]) -> String {
    let (Some(first), Some(last)) = (rounds.first(), rounds.last()) else {
        return String::new();
    };
    let rows = steps::rows(&first.steps, &last.steps);
    if rows.is_empty() {
        return String::new();
    }
    let mut text = format!("{}\n\n", wrap("", "", steps::CAPTION).trim_end());
    text += &table(&steps::HEADER, rows);
    if let Some(said) = last.not_linear() {
        text += "\n";
        text += &wrap("", "", &said);
    }
    text + "\n"
}

/// Before and after, round by round, and the verdict.
pub fn closed(page: &Page, closing: &Closing) -> String {
    let mut text = String::from("\nbefore and after\n\n");
    let rounds = &page.report.rounds;
    let rows = rounds.iter().enumerate().map(|(k, round)| {
        let r = &round.residual;
        let numbers = [r.rms_nm.u1, r.rms_nm.u2, r.noise_nm.u1, r.noise_nm.u2];
        once(format!("round {k}"))
            .chain([round.effects_declared.join(", ")])
            .chain(numbers.map(|v| format!("{v:.2}")))
            .chain([format!("{:.3}", r.chi2_reduced)])
            .chain([r.holdout_rms_nm.map_or("-".into(), |v| format!("{v:.2}"))])
            .collect()
    });
    let header = [
        "",
        "effects declared",
        "u1 nm",
        "u2 nm",
        "noise u1",
        "noise u2",
        "chi2/dof",
        "held-out nm",
    ];
    text += &table(&header, rows);
    text += "\n";
    text += &of_steps(rounds);
    text += &constants(page);
    if let Some(round) = &closing.with_discrepancy {
        text += "\nthe last model with the unexplained structure as a correlated discrepancy, if nothing acts that it does not declare\n\n";
        let rows = round
            .posterior
            .iter()
            .map(|(name, r)| mean_sd(name, r.mean, r.sd));
        text += &table(&["", "mean", "sd"], rows);
    }
    if let Some((last, found)) = rounds.last().and_then(|r| Some((r, r.tracing.as_ref()?))) {
        let (quoted, suspect) = (
            &closing.averaged_posterior,
            closing.verdict.suspect.as_ref(),
        );
        text += &averaged(found, quoted, suspect, &closing.blind_spots, &last.alone());
        if let Some(sampled) = &closing.quoted {
            text += &wrap("  ", "  ", &sampled.words());
        }
    }
    let verdict = &closing.verdict;
    let headline = match verdict.status {
        Status::Unexplained => "unexplained structure remains",
        other => other.words(),
    };
    text += "\n";
    text += &wrap("", "", &format!("VERDICT: {headline}. {}", verdict.text));
    text += &confirm(&verdict.confirm);
    text
}

/// The constants round by round, with what contradicts its prior.
fn constants(page: &Page) -> String {
    let rounds = &page.report.rounds;
    let names: Vec<String> = (0..rounds.len()).map(|k| format!("round {k}")).collect();
    let header: Vec<&str> = once("").chain(names.iter().map(String::as_str)).collect();
    let constants = page.constants();
    let rows = constants.iter().map(|name| {
        let cell = |m: Option<(f64, f64)>| m.map_or("-".into(), |(mean, sd)| plus_minus(mean, sd));
        let cells = rounds.iter().map(|r| cell(r.moments(name)));
        once((*name).to_string()).chain(cells).collect()
    });
    let mut text = table(&header, rows);
    for (k, round) in names.iter().enumerate() {
        let far = constants.iter().filter_map(|name| {
            let said = contradiction(page.from_prior(k, name)?)?;
            Some(format!("{name} {said}"))
        });
        let far: Vec<String> = far.collect();
        if !far.is_empty() {
            text += &wrap("  ", "  ", &format!("{round}: {}", far.join(", ")));
        }
    }
    text
}

/// The test of every member of every group that was named.
fn confirm(groups: &[Confirming]) -> String {
    let mut text = String::new();
    for group in groups {
        let _ = writeln!(text, "\n{}", group.question().replacen('W', "w", 1));
        for t in &group.tests {
            text += &wrap("  ", "    ", &format!("{}: {}", t.effect, t.test));
        }
    }
    text
}
