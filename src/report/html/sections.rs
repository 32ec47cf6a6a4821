//! The sections of a report.

use maud::{Markup, html};

use super::tables::names;
use super::{figure, fixed, mean_sd, minus, row, short, table, wide, with_sd};
use crate::report::figures::Figures;
use crate::report::page::Page;
use crate::report::round::{PosteriorSummary, RoundReport, beside_published};
use crate::report::steps;
use crate::trace::{Confirming, Interval, Status};

/// The verdict in a sentence, and what should be known before the numbers are used.
pub fn verdict(page: &Page) -> Markup {
    let Some(last) = page.report.last() else {
        return html! {};
    };
    let verdict = page.report.closing.as_ref().map(|c| &c.verdict);
    let open = match verdict {
        Some(verdict) => verdict.status == Status::Unexplained,
        None => !last.warnings.is_empty(),
    };
    let sentence = sentence(page, last);
    html! {
        p.verdict.open[open] {
            @if let Some(verdict) = verdict {
                strong { (capital(verdict.status.words())) ". " } (verdict.text.replace("+-", "\u{b1}"))
            } @else { (sentence) }
        }
        @if let Some(verdict) = verdict { p { (sentence) } (confirming(&verdict.confirm)) }
        @if !last.warnings.is_empty() {
            h3 { "Before you use these numbers" }
            ul.warnings { @for warning in &last.warnings { li { (options_kept(warning)) } } }
        }
    }
}

/// The test of every member of every group that the verdict names.
fn confirming(groups: &[Confirming]) -> Markup {
    html! {
        @for group in groups {
            h3 { (group.question()) }
            @if let [only] = &group.tests[..] { p { (only.test) } }
            @else {
                ul.warnings { @for t in &group.tests { li { strong { (t.effect) } ": " (t.test) } } }
            }
        }
    }
}

/// A text that begins a sentence.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// A sentence whose options (`--refine`) are not broken at their hyphens.
fn options_kept(text: &str) -> Markup {
    html! {
        @for word in text.split_inclusive(' ') {
            @if word.starts_with("--") { span.option { (word) } } @else { (word) }
        }
    }
}

/// The constants and the residual of the last round in a sentence.
fn sentence(page: &Page, last: &RoundReport) -> String {
    let alone = constants(page, &|name| last.moments(name));
    let constants = match &page.report.closing {
        Some(_) => {
            let of = |name: &str| page.report.averaged(name).map(|a| (a.mean, a.sd));
            let averaged = constants(page, &of);
            format!(
                "Averaged over effects that may act unseen: {averaged}. The last round's model alone: {alone}"
            )
        }
        None => alone,
    };
    let r = &last.residual;
    let not = if last.convergence.converged {
        ""
    } else {
        "NOT "
    };
    format!(
        "{constants}. The residual is {:.2} times the noise in u1 and {:.2} times in u2; reduced \u{3c7}\u{b2} {}. The chains have {not}converged.",
        r.rms_nm.u1 / r.noise_nm.u1,
        r.rms_nm.u2 / r.noise_nm.u2,
        short(r.chi2_reduced)
    )
}

/// Mean and sd of each constant.
fn constants(page: &Page, moments: &dyn Fn(&str) -> Option<(f64, f64)>) -> String {
    let one = |name: &&str| {
        let (symbol, unit) = name.split_once('_').unwrap_or((name, ""));
        let text = format!("{symbol} = {} {unit}", mean_sd(Some(moments(name)?)));
        Some(text.trim_end().replace(' ', "\u{a0}"))
    };
    let said: Vec<String> = page.constants().iter().filter_map(one).collect();
    said.join(", ")
}

/// The steps of a series: what is left of each, how the others predict it, and whether it is linear in the load.
pub fn steps(page: &Page, figures: &Figures) -> Markup {
    let (Some(first), Some(last)) = (page.report.rounds.first(), page.report.last()) else {
        return html! {};
    };
    let rows = steps::rows(&first.steps, &last.steps);
    if rows.is_empty() {
        return html! {};
    }
    let cells = |line: &Vec<String>| row(&line[0], line[1..].iter().map(|cell| minus(cell)));
    let rows: Vec<_> = rows.iter().map(cells).collect();
    html! {
        @if let Some(said) = last.not_linear() { p { (said) } }
        (table(steps::CAPTION, &steps::HEADER, rows, false))
        @if let Some(figure) = figures.get("steps") { (wide(figure)) }
        @if let Some(figure) = figures.get("stiffness") { (wide(figure)) }
    }
}

/// The mesh of another program, with what was measured on it.
pub fn mesh(figures: &Figures) -> Markup {
    html! {
        @if let Some(figure) = figures.get("mesh") { (wide(figure)) }
    }
}

/// Maps of every round.
pub fn maps(page: &Page, figures: &Figures) -> Markup {
    let names = names(page);
    html! {
        @for (panels, name) in figures.panels.iter().zip(&names) {
            h3 { (capital(name)) }
            div.maps { @for panel in panels { (figure(panel)) } }
        }
        @if !figures.closer.is_empty() {
            h3 { "The last residual on a scale of its own" }
            div.maps { @for panel in &figures.closer { (figure(panel)) } }
        }
        @if !figures.panels.is_empty() {
            p.soft {
                "Cells are means of the points in them; grey where nothing was measured. Measured and predicted share a scale; residuals share one over components and rounds, white at zero, which covers 99.5 % of them. Point at a map for the value of a cell."
            }
        }
        (by_round(page, figures, "Variogram of the residual", "variogram"))
        (by_round(page, figures, "Residual by rings and quadrants", "breakdown"))
    }
}

/// A figure of every round.
fn by_round(page: &Page, figures: &Figures, title: &str, figure: &str) -> Markup {
    html! {
        @for (k, name) in names(page).iter().enumerate() {
            @if let Some(figure) = figures.get(&format!("{figure}-{k}")) {
                h3 { (title) ": " (name) }
                (wide(figure))
            }
        }
    }
}

/// A row of the posterior's table.
fn summary(name: &str, [mean, sd, low, median, high]: [f64; 5]) -> Vec<String> {
    row(name, [mean, sd, low, median, high].map(|v| with_sd(v, sd)))
}

/// Constants: prior, rounds, averaged; summary; correlation; corner plots.
pub fn posterior(page: &Page, figures: &Figures) -> Markup {
    let rounds = &page.report.rounds;
    let last = rounds.len().saturating_sub(1);
    let header = ["", "mean", "sd", "2.5 %", "median", "97.5 %"];
    let drawn = |round: &RoundReport| {
        let row = |(name, s): (&String, &PosteriorSummary)| {
            let row = summary(name, [s.mean, s.sd, s.low, s.median, s.high]);
            (row, s.published)
        };
        beside_published(header, round.posterior.iter().map(row))
    };
    let mixed =
        |(name, a): (&String, &Interval)| summary(name, [a.mean, a.sd, a.low, a.median, a.high]);
    html! {
        @if let Some(figure) = figures.get("intervals") { (wide(figure)) }
        @for (round, name) in rounds.iter().zip(names(page)) {
            @let (header, rows) = drawn(round);
            (table(&format!("Posterior: {name}"), &header, rows.into_iter(), false))
        }
        @if let Some(closing) = &page.report.closing {
            (table("Averaged over effects that may act unseen", &header, closing.averaged_posterior.iter().map(mixed), false))
            @if let Some(quoted) = &closing.quoted { p { (quoted.words()) } }
            @if let Some(note) = &closing.averaged_note { p { (note) } }
            @if let Some(figure) = figures.get("corner-averaged") {
                h3 { "Joint posterior to quote, with the amplitudes that trade most against the constants" }
                (wide(figure))
            }
        }
        @if let Some(round) = rounds.last() { (correlation(round)) }
        @for k in [0, last].into_iter().take(1 + usize::from(last > 0)) {
            @if let Some(figure) = figures.get(&format!("corner-{k}")) {
                h3 { "Joint posterior: " (names(page)[k]) }
                (wide(figure))
                p.soft { "Dashed: prior. Red: truth, where it is known. Black: bounds at which a prior is cut. Shades hold 39, 86 and 99 % of the draws." }
            }
        }
    }
}

fn correlation(round: &RoundReport) -> Markup {
    let names = &round.correlation.names;
    let rows = names.iter().zip(&round.correlation.matrix);
    let rows = rows.map(|(name, r)| row(name, r.iter().map(|v| fixed(*v, 3))));
    let header = row("", names.iter().cloned());
    table("Correlation of the draws", &header, rows, false)
}

/// Whether the draws can be used.
pub fn convergence(page: &Page, figures: &Figures) -> Markup {
    let last = page.report.rounds.len().saturating_sub(1);
    let header = ["", "R-hat", "ESS bulk", "ESS tail", "MCSE of the mean"];
    let line = |(name, s): (&String, &PosteriorSummary)| {
        let [bulk, tail] = [s.ess_bulk, s.ess_tail].map(|v| fixed(v, 0));
        row(name, [fixed(s.rhat, 4), bulk, tail, short(s.mcse_mean)])
    };
    html! {
        @for (round, name) in page.report.rounds.iter().zip(names(page)) {
            (table(&format!("Chains of {name}"), &header, round.posterior.iter().map(line), true))
            @let c = &round.convergence;
            p.soft { (c.text) ". Not stored: " (c.burn_in) ". Ended because " (c.stopped) "." }
        }
        @for what in ["trace", "rank", "autocorrelation"] {
            @if let Some(figure) = figures.get(&format!("{what}-{last}")) { (wide(figure)) }
        }
    }
}

/// The reduced model's errors.
pub fn surrogate(page: &Page) -> Markup {
    let (Some(last), Some(data)) = (page.report.last(), page.figures.last()) else {
        return html! {};
    };
    let s = &last.surrogate;
    let truncation = data.truncation.iter().map(|t| {
        let numbers = [t.eps, t.cv_rms_mm, t.cv_rms_percent].map(scientific);
        row(
            t.modes.to_string(),
            [t.component.clone()].into_iter().chain(numbers),
        )
    });
    let surfaces = data.surfaces.iter().map(|s| {
        let numbers = [s.mean_mm, s.sd_mm, s.r2, s.rms_mm, s.press_mm];
        row(&s.coefficient, numbers.map(scientific))
    });
    let [truncation, surfaces]: [Vec<_>; 2] = [truncation.collect(), surfaces.collect()];
    html! {
        p {
            "Against " (s.truth()) " at " (s.truth_draws) " draws of the last posterior the reduced model moves no constant by more than "
            (short(100.0 * s.max_error_in_posterior_sd)) " % of its posterior sd; "
            (short(s.field_error_nm.max)) " nm is the largest error of the field. "
            @if let Some(error) = &s.over_the_box {
                "Over its whole box the field's error is " (short(error.rms)) " nm, " (short(error.max)) " nm at most. "
            }
            @if let Some(bound) = s.basis_bound_nm {
                "The reduced basis that stands for the finite elements there is off by " (format!("{bound:.1e}")) " nm at most, by its bound. "
            }
            (short(100.0 * s.draws_outside_doe)) " % of the draws lie outside its box."
        }
        @if !truncation.is_empty() {
            (table("Truncation error (Table 3 of the article) and leave-one-out error (Table 8) by number of modes", &["modes", "component", "eps", "cv_rms_mm", "cv_rms_percent"], truncation, true))
        }
        @if !surfaces.is_empty() {
            (table("Response surfaces of the POD coefficients (Tables 9 and 10)", &["coefficient", "mean_mm", "sd_mm", "r2", "rms_mm", "press_mm"], surfaces, true))
        }
    }
}

/// Four significant digits; about 1, as coefficients of determination are, six decimals.
fn scientific(value: Option<f64>) -> String {
    match value {
        Some(v) if (v - 1.0).abs() >= 0.1 => minus(&format!("{v:.3e}")),
        other => fixed(other, 6),
    }
}

/// How the run can be made again.
pub fn provenance(page: &Page) -> Markup {
    let manifest = &page.manifest;
    html! {
        dl {
            dt { "command" } dd { code { "plychain " (manifest.command.join(" ")) } }
            dt { "version" } dd { (manifest.version) }
            dt { "seed" } dd { (page.report.seed) }
            dt { "seconds" } dd { (short(manifest.seconds)) }
            @for (path, hash) in &manifest.inputs_sha256 {
                dt { "SHA-256" } dd { code { (path) } br; code { (hash) } }
            }
        }
        p.soft { "Draws: chain.zarr and chain.csv; of a loop those to quote in averaged/. Numbers: report.json. Figures with their numbers as CSV: figures/." }
    }
}
