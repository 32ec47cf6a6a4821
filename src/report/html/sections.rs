//! The sections of a report.

use maud::{Markup, html};
use serde_json::Value;

use super::tables::{list, moments, names};
use super::{figure, short, table, wide, with_sd};
use crate::report::figures::Figures;
use crate::report::page::{Page, words};
use crate::report::sheet::Sheet;

/// The verdict in a sentence, and what should be known before the numbers are used.
pub fn verdict(page: &Page) -> Markup {
    let verdict = &page.report["verdict"];
    let last = page.rounds().last().unwrap_or(&Value::Null);
    let text = verdict["text"].as_str().map(String::from);
    let status = verdict["status"].as_str();
    let warnings = list(&last["warnings"]);
    let open = match status {
        Some(status) => status == "unexplained",
        None => !warnings.is_empty(),
    };
    html! {
        p.verdict.open[open] {
            @if let Some(status) = status { strong { (capital(&status.replace('_', " "))) ". " } }
            (text.map_or_else(|| sentence(page), |t| t.replace("+-", "\u{b1}")))
        }
        @if status.is_some() { p { (sentence(page)) } }
        (confirming(verdict))
        @if !warnings.is_empty() {
            h3 { "Before you use these numbers" }
            ul.warnings { @for warning in &warnings { li { (options_kept(warning)) } } }
        }
    }
}

/// The test of every member of every group that the verdict names.
fn confirming(verdict: &Value) -> Markup {
    let groups = verdict["confirm"].as_array().map_or(&[][..], Vec::as_slice);
    html! {
        @for group in groups {
            @let tests = group["tests"].as_array().map_or(&[][..], Vec::as_slice);
            @let leader = tests.first().map_or(String::new(), |t| words(&t["effect"]));
            h3 {
                @if tests.len() > 1 { "What would tell " (leader) " from what could stand in for it" }
                @else { "What would confirm " (leader) }
            }
            @if let [test] = tests { p { (words(&test["test"])) } }
            @else {
                ul.warnings { @for test in tests {
                    li { strong { (words(&test["effect"])) } ": " (words(&test["test"])) }
                } }
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
fn sentence(page: &Page) -> String {
    let last = page.rounds().last().unwrap_or(&Value::Null);
    let averaged = &page.report["averaged_posterior"];
    let alone = constants(page, &last["posterior"]);
    let constants = if averaged.is_object() {
        format!(
            "Averaged over effects that may act unseen: {}. The last round's model alone: {alone}",
            constants(page, averaged)
        )
    } else {
        alone
    };
    let rms = |c: &str| {
        let ratio =
            last["residual"]["rms_nm"][c].as_f64()? / last["residual"]["noise_nm"][c].as_f64()?;
        Some(format!("{ratio:.2}"))
    };
    let ratio = rms("u1").zip(rms("u2"));
    let residual = ratio.map_or(String::new(), |(u1, u2)| {
        format!(
            " The residual is {u1} times the noise in u1 and {u2} times in u2; reduced \u{3c7}\u{b2} {}.",
            short(&last["residual"]["chi2_reduced"])
        )
    });
    let converged = match last["convergence"]["converged"].as_bool() {
        Some(true) => " The chains have converged.",
        Some(false) => " The chains have NOT converged.",
        None => "",
    };
    format!("{constants}.{residual}{converged}")
}

/// Mean and sd of each constant in a posterior of the report.
fn constants(page: &Page, posterior: &Value) -> String {
    let one = |name: &String| {
        let (mean, sd) = moments(&posterior[name])?;
        let (symbol, unit) = name.split_once('_').unwrap_or((name, ""));
        let text = format!(
            "{symbol} = {} \u{b1} {} {unit}",
            with_sd(mean, sd),
            with_sd(sd, sd)
        );
        Some(text.trim_end().replace(' ', "\u{a0}"))
    };
    let said: Vec<String> = page.constants().iter().filter_map(one).collect();
    said.join(", ")
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
        (variograms(page, figures))
        (breakdowns(page, figures))
    }
}

/// Where the residual lies: rings about the hole, and quadrants.
fn breakdowns(page: &Page, figures: &Figures) -> Markup {
    html! {
        @for (k, name) in (0..).zip(names(page)) {
            @if let Some(figure) = figures.get(&format!("breakdown-{k}")) {
                h3 { "Residual by rings and quadrants: " (name) }
                (wide(figure))
            }
        }
    }
}

fn variograms(page: &Page, figures: &Figures) -> Markup {
    html! {
        @for (k, name) in (0..).zip(names(page)) {
            @if let Some(figure) = figures.get(&format!("variogram-{k}")) {
                h3 { "Variogram of the residual: " (name) }
                (wide(figure))
            }
        }
    }
}

/// Constants: prior, rounds, averaged; summary; correlation; corner plots.
pub fn posterior(page: &Page, figures: &Figures) -> Markup {
    let last = page.rounds().len().saturating_sub(1);
    let header: Vec<String> = ["", "mean", "sd", "2.5 %", "median", "97.5 %"]
        .map(String::from)
        .into();
    let of = |entries: &Value| -> Vec<Vec<String>> {
        let entries = entries.as_object().into_iter().flatten();
        entries
            .map(|(name, e)| {
                let sd = e["sd"].as_f64().unwrap_or(f64::NAN);
                let cell = |key: &str| {
                    e[key]
                        .as_f64()
                        .map_or("\u{2013}".into(), |v| with_sd(v, sd))
                };
                std::iter::once(name.clone())
                    .chain(["mean", "sd", "q2.5", "median", "q97.5"].map(cell))
                    .collect()
            })
            .collect()
    };
    let averaged = of(&page.report["averaged_posterior"]);
    html! {
        @if let Some(figure) = figures.get("intervals") { (wide(figure)) }
        @for (round, name) in page.rounds().iter().zip(names(page)) {
            (table(&format!("Posterior: {name}"), &header, &of(&round["posterior"]), false))
        }
        @if !averaged.is_empty() {
            (table("Averaged over effects that may act unseen", &header, &averaged, false))
            @if let Some(note) = page.report["averaged_note"].as_str() { p { (note) } }
        }
        @if let Some(round) = page.rounds().last() { (correlation(round)) }
        @for k in [0, last].into_iter().take(1 + usize::from(last > 0)) {
            @if let Some(figure) = figures.get(&format!("corner-{k}")) {
                h3 { "Joint posterior: " (names(page)[k]) }
                (wide(figure))
                p.soft { "Dashed: prior. Red: truth, where it is known. Black: bounds at which a prior is cut. Shades hold 39, 86 and 99 % of the draws." }
            }
        }
    }
}

fn correlation(round: &Value) -> Markup {
    let names = list(&round["correlation"]["names"]);
    let rows: Vec<Vec<String>> = names
        .iter()
        .zip(
            round["correlation"]["matrix"]
                .as_array()
                .into_iter()
                .flatten(),
        )
        .map(|(name, row)| {
            let cells = row.as_array().into_iter().flatten();
            let cell = |v: &Value| {
                v.as_f64().map_or("\u{2013}".into(), |v| {
                    format!("{v:.3}").replace('-', "\u{2212}")
                })
            };
            std::iter::once(name.clone())
                .chain(cells.map(cell))
                .collect()
        })
        .collect();
    let header: Vec<String> = std::iter::once(String::new())
        .chain(names.iter().cloned())
        .collect();
    html! { @if !rows.is_empty() { (table("Correlation of the draws", &header, &rows, false)) } }
}

/// Whether the draws can be used.
pub fn convergence(page: &Page, figures: &Figures) -> Markup {
    let last = page.rounds().len().saturating_sub(1);
    let header: Vec<String> = ["", "R-hat", "ESS bulk", "ESS tail", "MCSE of the mean"]
        .map(String::from)
        .into();
    html! {
        @for (round, name) in page.rounds().iter().zip(names(page)) {
            @let rows: Vec<Vec<String>> = round["posterior"].as_object().into_iter().flatten().map(|(name, e)| vec![
                name.clone(),
                e["rhat"].as_f64().map_or("\u{2013}".into(), |v| format!("{v:.4}")),
                e["ess_bulk"].as_f64().map_or("\u{2013}".into(), |v| format!("{v:.0}")),
                e["ess_tail"].as_f64().map_or("\u{2013}".into(), |v| format!("{v:.0}")),
                short(&e["mcse_mean"]),
            ]).collect();
            (table(&format!("Chains of {name}"), &header, &rows, true))
            p.soft {
                (words(&round["convergence"]["text"])) ". Not stored: "
                (words(&round["convergence"]["burn_in"])) ". Ended because " (words(&round["convergence"]["stopped"])) "."
            }
        }
        @for what in ["trace", "rank", "autocorrelation"] {
            @if let Some(figure) = figures.get(&format!("{what}-{last}")) { (wide(figure)) }
        }
    }
}

/// The reduced model's errors.
pub fn surrogate(page: &Page) -> Markup {
    let count = page.rounds().len().saturating_sub(1);
    let Some(last) = page.rounds().last() else {
        return html! {};
    };
    let s = &last["surrogate"];
    let outside = s["draws_outside_doe"].as_f64().unwrap_or_default();
    let error = s["max_error_in_posterior_sd"].as_f64().unwrap_or_default();
    html! {
        p {
            "Against the finite elements at " (s["truth_draws"]) " draws of the last posterior the reduced model moves no constant by more than "
            (short(&Value::from(100.0 * error))) " % of its posterior sd; "
            (short(&s["field_error_nm"]["max"])) " nm is the largest error of the field. "
            (short(&Value::from(100.0 * outside))) " % of the draws lie outside its box."
        }
        @if let Some(sheet) = page.sheet(&format!("truncation-{count}")) {
            (of_sheet("Truncation error (Table 3 of the article) and leave-one-out error (Table 8) by number of modes", sheet))
        }
        @if let Some(sheet) = page.sheet(&format!("surfaces-{count}")) {
            (of_sheet("Response surfaces of the POD coefficients (Tables 9 and 10)", sheet))
        }
    }
}

fn of_sheet(caption: &str, sheet: &Sheet) -> Markup {
    let cell = |text: &String| match text.parse::<f64>() {
        Ok(v) if text.contains(['.', 'e']) && (v - 1.0).abs() < 0.1 => format!("{v:.6}"),
        Ok(v) if text.contains(['.', 'e']) => format!("{v:.3e}").replace('-', "\u{2212}"),
        _ if text.is_empty() => "\u{2013}".into(),
        _ => text.clone(),
    };
    let rows: Vec<Vec<String>> = sheet
        .rows
        .iter()
        .map(|row| row.iter().map(cell).collect())
        .collect();
    table(caption, &sheet.header, &rows, true)
}

/// How the run can be made again.
pub fn provenance(page: &Page) -> Markup {
    let command: Vec<String> = list(&page.manifest["command"]);
    let inputs = page.manifest["inputs_sha256"].as_object();
    html! {
        dl {
            dt { "command" } dd { code { "plychain " (command.join(" ")) } }
            dt { "version" } dd { (words(&page.manifest["version"])) }
            dt { "seed" } dd { (page.report["seed"]) }
            dt { "seconds" } dd { (short(&page.manifest["seconds"])) }
            @for (path, hash) in inputs.into_iter().flatten() {
                dt { "SHA-256" } dd { code { (path) } br; code { (words(hash)) } }
            }
        }
        p.soft { "Draws: chain.zarr and chain.csv. Numbers: report.json. Figures with their numbers as CSV: figures/." }
    }
}
