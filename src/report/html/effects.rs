//! The sections about effects: what the residual was traced to, and what could hide in it.

use maud::{Markup, html};
use serde_json::Value;

use super::tables::{list, moments, names};
use super::{short, table, wide};
use crate::quantity::plus_minus;
use crate::report::figures::{Figures, SMALLEST_BAR};
use crate::report::page::{Page, effect_name, words};
use crate::report::traced::{ALIKE, LINEAR, LINEAR_PERCENT, PROBABLE, shift};

/// Ranking of the candidates of every round.
pub fn ranking(page: &Page, figures: &Figures) -> Markup {
    let header: Vec<String> = [
        "effect",
        "probability",
        "log Bayes factor",
        "amplitude",
        "alone explains",
        "detectable from",
        "resembles (cosine)",
    ]
    .map(String::from)
    .into();
    html! {
        @for ((k, round), name) in (0..).zip(page.rounds()).zip(names(page)) {
            @if let Some(candidates) = round["candidates"].as_array().filter(|c| !c.is_empty()) {
                h3 { "Effects weighed against the residual: " (name) }
                @let accepted = list(&round["accepted"]);
                p {
                    @if accepted.is_empty() { "No effect was accepted." }
                    @else { "Accepted: " (accepted.join(", ")) "." }
                    @if let Some(p) = round["discrepancy_probability"].as_f64() {
                        " Probability of smooth structure that no effect explains: " (format!("{p:.3}")) "."
                    }
                }
                @if let Some(figure) = figures.get(&format!("candidates-{k}")) { (wide(figure)) }
                (improbable(candidates))
                @let rows: Vec<_> = candidates.iter().map(candidate).collect();
                (table("Candidates: probability that the effect acts, its amplitude if it does, and what could stand in for it", &header, &rows, true))
                (left_out(round))
            }
        }
    }
}

/// How many candidates have no bar.
fn improbable(candidates: &[Value]) -> Markup {
    let below = |c: &&Value| {
        c["inclusion_probability"]
            .as_f64()
            .is_some_and(|p| p < SMALLEST_BAR)
    };
    let count = candidates.iter().filter(below).count();
    html! {
        @if count > 0 {
            p.soft { (count) " of " (candidates.len()) " effects have a probability below " (SMALLEST_BAR) " and no bar." }
        }
    }
}

fn candidate(found: &Value) -> Vec<String> {
    let amplitude: Vec<String> = found["amplitude"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|a| {
            let name = words(&a["parameter"]);
            let value = moments(a).map_or("\u{2013}".into(), |(mean, sd)| {
                plus_minus(mean, sd)
                    .replace("+-", "\u{b1}")
                    .replace('-', "\u{2212}")
            });
            format!("{name} {value}").replace(' ', "\u{a0}")
        })
        .collect();
    let mut aliases: Vec<String> = found["aliases"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|a| a["cosine"].as_f64().is_some_and(|c| c >= ALIKE))
        .map(|a| format!("{} ({})", words(&a["effect"]), short(&a["cosine"])))
        .collect();
    let more = aliases.len().saturating_sub(SHOWN);
    if more > 0 {
        aliases.truncate(SHOWN);
        aliases.push(format!("{more} more in report.json"));
    }
    let implausible = found["implausible"].as_bool() == Some(true);
    let probability = found["inclusion_probability"].as_f64();
    let percent = found["explained_fraction"]
        .as_f64()
        .filter(|_| probability.is_some_and(|p| p >= PROBABLE));
    vec![
        words(&found["effect"]),
        found["inclusion_probability"]
            .as_f64()
            .map_or("\u{2013}".into(), |p| format!("{p:.3}")),
        short(&found["log_bayes_factor"]),
        amplitude.join(", ")
            + if implausible {
                " (implausibly large)"
            } else {
                ""
            },
        percent.map_or("\u{2013}".into(), |f| format!("{:.0} %", 100.0 * f)),
        never(&found["detectable"]),
        aliases.join(", "),
    ]
}

/// An amplitude; `null` stands for what none reaches.
fn never(value: &Value) -> String {
    if value.is_null() {
        "never".into()
    } else {
        short(value)
    }
}

/// Aliases in the table, at most.
const SHOWN: usize = 3;

/// Effects that were not weighed, with the reason.
fn left_out(round: &Value) -> Markup {
    let left = round["left_out"].as_array().map_or(&[][..], Vec::as_slice);
    html! {
        @if !left.is_empty() {
            p.soft { "Not weighed: "
                @for (k, entry) in left.iter().enumerate() {
                    @if k > 0 { "; " }
                    (words(&entry["effect"])) " (" (words(&entry["reason"])) ")"
                }
                "."
            }
        }
    }
}

/// What could hide in the residual.
pub fn blind_spots(page: &Page, figures: &Figures) -> Markup {
    let Some(spots) = page.report["blind_spots"]
        .as_array()
        .filter(|s| !s.is_empty())
    else {
        return html! {};
    };
    let constants = page.constants();
    let mut header: Vec<String> = [
        "effect",
        "plausible size",
        "detectable from",
        "would be seen",
    ]
    .map(String::from)
    .into();
    header.extend(constants.iter().map(|c| format!("shift of {c}, %")));
    let rows: Vec<Vec<String>> = spots
        .iter()
        .map(|spot| {
            let seen = spot["would_be_seen"].as_bool().unwrap_or_default();
            let size = format!("{} {}", short(&spot["plausible"]), words(&spot["unit"]));
            let mut row = vec![
                effect_name(spot),
                size.trim_end().to_string(),
                never(&spot["detectable"]),
                if seen { "yes" } else { "NO" }.into(),
            ];
            row.extend(constants.iter().map(|c| {
                let value = &spot["shift_in_percent"][c];
                match value.as_f64() {
                    Some(s) if s.abs() > LINEAR_PERCENT => shift(s, 0).replace('-', "\u{2212}"),
                    _ => short(value),
                }
            }));
            row
        })
        .collect();
    html! {
        p { "An effect that these data would not show can still move the constants. The averaged posterior counts it; the posterior of a single model does not." }
        @if let Some(figure) = figures.get("blind-spots") { (wide(figure)) }
        p.soft { (LINEAR) }
        (table("What each effect would do at its plausible size if the model lacked it", &header, &rows, true))
    }
}
