//! The table of rounds side by side: residual, held-out error and constants before and after.

use maud::{Markup, html};
use serde_json::Value;

use super::{short, table, with_sd};
use crate::report::page::{Page, words};
use crate::report::traced::contradiction;

/// Names of the rounds: what each added to the model.
pub fn names(page: &Page) -> Vec<String> {
    let mut before: Vec<String> = Vec::new();
    page.rounds()
        .iter()
        .enumerate()
        .map(|(k, round)| {
            let declared = list(&round["effects_declared"]);
            let added: Vec<String> = declared
                .iter()
                .filter(|e| !before.contains(e))
                .cloned()
                .collect();
            before = declared;
            match (k, added.is_empty()) {
                (0, _) => "round 0, as declared".to_string(),
                (_, true) => format!("round {k}"),
                (_, false) => format!("round {k}, with {}", added.join(", ")),
            }
        })
        .collect()
}

/// The texts of an array.
pub fn list(value: &Value) -> Vec<String> {
    value.as_array().into_iter().flatten().map(words).collect()
}

/// Rounds side by side.
pub fn rounds(page: &Page) -> Markup {
    let rounds = page.rounds();
    let mut header = vec![String::new()];
    header.extend(names(page));
    let mut rows = Vec::new();
    for (what, key) in [
        ("residual RMS u1, nm", "/residual/rms_nm/u1"),
        ("residual RMS u2, nm", "/residual/rms_nm/u2"),
        ("noise u1, nm", "/residual/noise_nm/u1"),
        ("noise u2, nm", "/residual/noise_nm/u2"),
        ("reduced \u{3c7}\u{b2}", "/residual/chi2_reduced"),
        ("held-out RMS, nm", "/residual/holdout_rms_nm"),
        (
            "structured share of the variance",
            "/residual/structured_fraction",
        ),
        ("p of no spatial structure", "/residual/p_spatial"),
        ("log evidence", "/residual/log_evidence"),
    ] {
        let cells: Vec<&Value> = rounds
            .iter()
            .map(|r| r.pointer(key).unwrap_or(&Value::Null))
            .collect();
        if cells.iter().any(|c| c.is_number()) {
            rows.push(row(what, cells.into_iter().map(short)));
        }
    }
    let residual = table("Residual against the noise", &header, &rows, false);
    html! {
        (residual)
        (constants(page, &header))
        (amplitudes(page, &header))
    }
}

fn row(name: &str, cells: impl Iterator<Item = String>) -> Vec<String> {
    std::iter::once(name.to_string()).chain(cells).collect()
}

/// Mean and sd of a posterior's entry.
pub fn moments(entry: &Value) -> Option<(f64, f64)> {
    Some((entry["mean"].as_f64()?, entry["sd"].as_f64()?))
}

fn plus_minus(entry: &Value) -> String {
    moments(entry).map_or("\u{2013}".into(), |(mean, sd)| {
        format!("{} \u{b1} {}", with_sd(mean, sd), with_sd(sd, sd))
    })
}

/// Constants of every round and averaged, and their errors where the truth is known.
fn constants(page: &Page, header: &[String]) -> Markup {
    let averaged = &page.report["averaged_posterior"];
    let mut header = header.to_vec();
    if averaged.is_object() {
        header.push("averaged over unseen effects".into());
    }
    let known = page
        .constants()
        .iter()
        .any(|n| page.true_value(n).is_some());
    if known {
        header.push("truth".into());
    }
    let mut rows = Vec::new();
    let mut errors = Vec::new();
    for name in page.constants() {
        let mut entries: Vec<&Value> = page
            .rounds()
            .iter()
            .map(|r| &r["posterior"][&name])
            .collect();
        if averaged.is_object() {
            entries.push(&averaged[&name]);
        }
        let mut cells = row(&name, entries.iter().map(|e| plus_minus(e)));
        for (k, entry) in page.rounds().iter().enumerate() {
            if let Some(said) = far(page, k, &name, &entry["posterior"][&name]) {
                cells[k + 1] += &format!(", {said}");
            }
        }
        if let Some(truth) = page.true_value(&name) {
            cells.push(format!("{truth}"));
            let error = |entry: &&Value| {
                moments(entry).map_or("\u{2013}".into(), |(mean, sd)| {
                    let percent = 100.0 * (mean - truth) / truth;
                    let sds = (mean - truth) / sd;
                    format!("{percent:+.2} % ({sds:+.1} sd)").replace('-', "\u{2212}")
                })
            };
            errors.push(row(&name, entries.iter().map(error)));
        }
        rows.push(cells);
    }
    let without_truth = &header[..header.len() - usize::from(known)];
    html! {
        (table("Constants: posterior mean \u{b1} sd", &header, &rows, false))
        @if let Some(note) = page.report["averaged_note"].as_str() { p { (note) } }
        @if !errors.is_empty() {
            (table("Error of the mean against the truth of the simulation, and in posterior sd", without_truth, &errors, false))
        }
    }
}

/// What is said of a round's constant that contradicts its prior.
fn far(page: &Page, round: usize, name: &str, entry: &Value) -> Option<String> {
    let sheet = page.sheet(&format!("parameters-{round}"))?;
    let row = sheet.only("parameter", name);
    let of = |column: &str| {
        row.numbers(column)
            .first()
            .copied()
            .filter(|x| x.is_finite())
    };
    let sds = (moments(entry)?.0 - of("prior_mean")?) / of("prior_sd")?;
    Some(contradiction(sds)?.replace('-', "\u{2212}"))
}

/// Amplitudes of the declared effects in every round.
fn amplitudes(page: &Page, header: &[String]) -> Markup {
    let mut names: Vec<String> = Vec::new();
    for round in page.rounds() {
        for (name, _) in round["effect_amplitudes"].as_object().into_iter().flatten() {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
    }
    let known = names.iter().any(|n| page.true_value(n).is_some());
    let mut header = header.to_vec();
    if known {
        header.push("truth".into());
    }
    let rows: Vec<Vec<String>> = names
        .iter()
        .map(|name| {
            let entries = page.rounds().iter().map(|r| &r["effect_amplitudes"][name]);
            let mut cells = row(name, entries.map(plus_minus));
            if known {
                let truth = page.true_value(name);
                cells.push(truth.map_or("\u{2013}".into(), |t| format!("{t}")));
            }
            cells
        })
        .collect();
    html! {
        @if !rows.is_empty() { (table("Amplitudes of declared effects: mean \u{b1} sd", &header, &rows, false)) }
    }
}
