//! The table of rounds side by side: residual, held-out error and constants before and after.

use maud::{Markup, html};

use super::{DASH, mean_sd, minus, row, short, table};
use crate::report::page::Page;
use crate::report::round::RoundReport;
use crate::report::words::contradiction;
use crate::trace::Suspect;

/// Names of the rounds: what each added to the model.
pub fn names(page: &Page) -> Vec<String> {
    let mut before: &[String] = &[];
    let name = |(k, round): (usize, &'_ RoundReport), before: &[String]| {
        let declared = round.effects_declared.iter();
        let added: Vec<_> = declared.filter(|e| !before.contains(e)).cloned().collect();
        match (k, added.is_empty()) {
            (0, _) => "round 0, as declared".to_string(),
            (_, true) => format!("round {k}"),
            (_, false) => format!("round {k}, with {}", added.join(", ")),
        }
    };
    let mut names = Vec::new();
    for (k, round) in page.report.rounds.iter().enumerate() {
        names.push(name((k, round), before));
        before = &round.effects_declared;
    }
    names
}

/// A number of a round.
pub type Number = (&'static str, fn(&RoundReport) -> Option<f64>);

/// What of a round's residual is shown.
pub const RESIDUAL: [Number; 6] = [
    ("residual RMS u1, nm", |r| Some(r.residual.rms_nm.u1)),
    ("residual RMS u2, nm", |r| Some(r.residual.rms_nm.u2)),
    ("noise u1, nm", |r| Some(r.residual.noise_nm.u1)),
    ("noise u2, nm", |r| Some(r.residual.noise_nm.u2)),
    ("reduced \u{3c7}\u{b2}", |r| Some(r.residual.chi2_reduced)),
    ("held-out RMS, nm", |r| r.residual.holdout_rms_nm),
];

const STRUCTURE: [Number; 2] = [
    ("structured share of the variance", |r| {
        Some(r.residual.structured_fraction)
    }),
    ("p of no spatial structure", |r| Some(r.residual.p_spatial)),
];

/// Rounds side by side.
pub fn rounds(page: &Page) -> Markup {
    let rounds = &page.report.rounds;
    let header = row("", names(page));
    let numbers = RESIDUAL.iter().chain(&STRUCTURE);
    let rows = numbers.filter_map(|(what, of)| {
        let cells: Vec<_> = rounds.iter().map(of).collect();
        let any = cells.iter().any(Option::is_some);
        any.then(|| row(*what, cells.into_iter().map(short)))
    });
    html! {
        (table("Residual against the noise", &header, rows, false))
        (constants(page, &header))
        (amplitudes(page, &header))
    }
}

/// The constants by each answer, where the account of the residual is not unique.
fn answers(suspect: &Suspect) -> Markup {
    let constants = suspect.answers.first().map(|a| &a.constants);
    let mut header = vec!["supposing".to_string()];
    header.extend(constants.into_iter().flat_map(|c| c.keys().cloned()));
    let rows = suspect.answers.iter().map(|answer| {
        let moments = answer
            .constants
            .values()
            .map(|i| mean_sd(Some((i.mean, i.sd))));
        row(&answer.supposing, moments)
    });
    let why = suspect.reasons.join("; ");
    html! {
        p { "The account of the residual is not unique: " (why) "." }
        (table("Constants by each answer: mean \u{b1} sd", &header, rows.collect::<Vec<_>>(), false))
    }
}

/// Constants of every round and averaged, and their errors where the truth is known.
fn constants(page: &Page, header: &[String]) -> Markup {
    let closing = page.report.closing.as_ref();
    let mut header = header.to_vec();
    let suspect = closing.and_then(|c| c.verdict.suspect.as_ref());
    let quoted = match suspect {
        Some(_) => "to quote: spans the answers below",
        None => "averaged over unseen effects",
    };
    header.extend(closing.map(|_| quoted.into()));
    let without_truth = header.clone();
    if page
        .constants()
        .iter()
        .any(|n| page.true_value(n).is_some())
    {
        header.push("truth".into());
    }
    let mut rows = Vec::new();
    let mut errors = Vec::new();
    for name in page.constants() {
        let mut entries: Vec<_> = page.report.rounds.iter().map(|r| r.moments(name)).collect();
        entries.extend(closing.map(|_| page.report.averaged(name).map(|a| (a.mean, a.sd))));
        let mut cells = row(name, entries.iter().copied().map(mean_sd));
        for (k, cell) in cells[1..].iter_mut().enumerate() {
            if let Some(said) = page.from_prior(k, name).and_then(contradiction) {
                *cell += &format!(", {}", minus(&said));
            }
        }
        if let Some(truth) = page.true_value(name) {
            cells.push(format!("{truth}"));
            let error = |(mean, sd): (f64, f64)| {
                let percent = 100.0 * (mean - truth) / truth;
                minus(&format!("{percent:+.2} % ({:+.1} sd)", (mean - truth) / sd))
            };
            let cells = entries.iter().map(|e| e.map_or(DASH.into(), error));
            errors.push(row(name, cells));
        }
        rows.push(cells);
    }
    html! {
        (table("Constants: posterior mean \u{b1} sd", &header, rows, false))
        @if let Some(suspect) = suspect { (answers(suspect)) }
        @else if let Some(note) = closing.and_then(|c| c.averaged_note.as_ref()) { p { (note) } }
        @if !errors.is_empty() {
            (table("Error of the mean against the truth of the simulation, and in posterior sd", &without_truth, errors, false))
        }
    }
}

/// Amplitudes of the declared effects in every round.
fn amplitudes(page: &Page, header: &[String]) -> Markup {
    let rounds = &page.report.rounds;
    let mut names: Vec<&String> = Vec::new();
    for name in rounds.iter().flat_map(|r| r.effect_amplitudes.keys()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let known = names.iter().any(|n| page.true_value(n).is_some());
    let mut header = header.to_vec();
    header.extend(known.then(|| "truth".into()));
    let rows = names.iter().map(|name| {
        let entries = rounds.iter().map(|r| r.effect_amplitudes.get(*name));
        let mut cells = row(*name, entries.map(|e| mean_sd(e.map(|a| (a.mean, a.sd)))));
        if known {
            let truth = page.true_value(name);
            cells.push(truth.map_or(DASH.into(), |t| format!("{t}")));
        }
        cells
    });
    let rows: Vec<_> = rows.collect();
    html! {
        @if !rows.is_empty() { (table("Amplitudes of declared effects: mean \u{b1} sd", &header, rows, false)) }
    }
}
