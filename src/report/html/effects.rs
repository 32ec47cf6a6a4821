//! The sections about effects: what the residual was traced to, and what could hide in it.

use maud::{Markup, html};

use super::tables::names;
use super::{fixed, minus, row, short, table, wide};
use crate::quantity::plus_minus;
use crate::report::figures::{Figures, SMALLEST_BAR};
use crate::report::page::Page;
use crate::report::tracing::{CandidateReport, TracingReport};
use crate::report::words::{ALIKE, LINEAR, LINEAR_PERCENT, PROBABLE, beyond_the_dictionary, shift};

/// Ranking of the candidates of every round.
pub fn ranking(page: &Page, figures: &Figures) -> Markup {
    let header = [
        "effect",
        "probability",
        "log Bayes factor",
        "amplitude",
        "alone explains",
        "detectable from",
        "resembles (cosine)",
    ];
    let rounds = page.report.rounds.iter().map(|r| r.tracing.as_ref());
    html! {
        @for ((k, tracing), name) in rounds.enumerate().zip(names(page)) {
            @if let Some(tracing) = tracing.filter(|t| !t.candidates.is_empty()) {
                h3 { "Effects weighed against the residual: " (name) }
                p {
                    @if tracing.accepted.is_empty() { "No effect was accepted." }
                    @else { "Accepted: " (tracing.accepted.join(", ")) "." }
                    @if let Some(p) = tracing.discrepancy_probability {
                        " Probability of smooth structure that no effect explains: " (format!("{p:.3}")) "."
                    }
                }
                @if let Some(figure) = figures.get(&format!("candidates-{k}")) { (wide(figure)) }
                (improbable(&tracing.candidates))
                (table("Candidates: probability that the effect acts, its amplitude if it does, and what could stand in for it", &header, tracing.candidates.iter().map(candidate), true))
                (left_out(tracing))
            }
        }
    }
}

/// How many candidates have no bar.
fn improbable(candidates: &[CandidateReport]) -> Markup {
    let below = candidates
        .iter()
        .filter(|c| c.inclusion_probability < SMALLEST_BAR);
    let count = below.count();
    html! {
        @if count > 0 {
            p.soft { (count) " of " (candidates.len()) " effects have a probability below " (SMALLEST_BAR) " and no bar." }
        }
    }
}

/// Aliases in the table, at most.
const SHOWN: usize = 3;

fn candidate(found: &CandidateReport) -> Vec<String> {
    let amplitude = found.amplitude.iter().map(|a| {
        let value = minus(&plus_minus(a.mean, a.sd).replace("+-", "\u{b1}"));
        format!("{} {value}", a.parameter).replace(' ', "\u{a0}")
    });
    let aliases = found.aliases.iter().filter(|a| a.cosine >= ALIKE);
    let mut aliases: Vec<String> = aliases
        .map(|a| format!("{} ({})", a.name(), short(a.cosine)))
        .collect();
    let more = aliases.len().saturating_sub(SHOWN);
    if more > 0 {
        aliases.truncate(SHOWN);
        aliases.push(format!("{more} more in report.json"));
    }
    let flag = if found.implausible {
        " (implausibly large)"
    } else {
        ""
    };
    let p = found.inclusion_probability;
    let explained = found.explained_fraction.filter(|_| p >= PROBABLE);
    vec![
        found.name(),
        format!("{p:.3}"),
        short(found.log_bayes_factor),
        amplitude.collect::<Vec<_>>().join(", ") + flag,
        explained.map_or(fixed(None, 0), |f| format!("{:.0} %", 100.0 * f)),
        never(found.detectable),
        aliases.join(", "),
    ]
}

/// An amplitude that may not exist.
fn never(amplitude: Option<f64>) -> String {
    amplitude.map_or("never".into(), short)
}

/// Effects that were not weighed, with the reason.
fn left_out(tracing: &TracingReport) -> Markup {
    let left = tracing.left_out.iter();
    let left: Vec<_> = left
        .map(|l| format!("{} ({})", l.effect, l.reason))
        .collect();
    html! {
        @if !left.is_empty() { p.soft { "Not weighed: " (left.join("; ")) "." } }
    }
}

/// What could hide in the residual.
pub fn blind_spots(page: &Page, figures: &Figures) -> Markup {
    let spots = page.report.blind_spots();
    if spots.is_empty() {
        return html! {};
    }
    let constants = page.constants();
    let mut header = row(
        "effect",
        ["plausible size", "detectable from", "would be seen"].map(String::from),
    );
    header.extend(constants.iter().map(|c| format!("shift of {c}, %")));
    let rows = spots.iter().map(|spot| {
        let size = format!("{} {}", short(spot.plausible), spot.unit);
        let seen = if spot.would_be_seen { "yes" } else { "NO" };
        let mut cells = row(
            spot.name(),
            [size.trim_end().into(), never(spot.detectable), seen.into()],
        );
        cells.extend(constants.iter().map(|c| match spot.shift(c) {
            Some(s) if s.abs() > LINEAR_PERCENT => minus(&shift(s, 0)),
            other => short(other),
        }));
        cells
    });
    html! {
        p { "An effect that these data would not show can still move the constants. The averaged posterior counts it; the posterior of a single model does not." }
        @if let Some(figure) = figures.get("blind-spots") { (wide(figure)) }
        p.soft { (LINEAR) " " (beyond_the_dictionary()) }
        (table("What each effect would do at its plausible size if the model lacked it", &header, rows, true))
    }
}
