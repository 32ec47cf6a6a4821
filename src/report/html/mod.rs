//! `report.html`: one file that needs nothing else, for a screen and for paper.

mod compare;
mod effects;
mod sections;
mod tables;

use std::iter::once;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::figures::{Figure, Figures};
use super::page::Page;
use crate::quantity::significant;
pub use compare::comparison;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// Nothing but what the page itself carries may be loaded.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// A whole document.
pub fn document(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                link rel="icon" href="data:,";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (body)
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// The report of a run.
pub fn report(page: &Page, figures: &Figures) -> String {
    let name = &page.report.model;
    let sections = [
        ("before-after", "Before and after", tables::rounds(page)),
        ("together", "All experiments", together(page)),
        ("steps", "Steps", sections::steps(page, figures)),
        ("mesh", "Mesh", sections::mesh(figures)),
        ("maps", "Maps", sections::maps(page, figures)),
        ("effects", "Effects", effects::ranking(page, figures)),
        (
            "blind-spots",
            "Blind spots",
            effects::blind_spots(page, figures),
        ),
        ("posterior", "Posterior", sections::posterior(page, figures)),
        (
            "convergence",
            "Convergence",
            sections::convergence(page, figures),
        ),
        ("surrogate", "Reduced model", sections::surrogate(page)),
        ("provenance", "Provenance", sections::provenance(page)),
    ];
    let present: Vec<_> = sections
        .into_iter()
        .filter(|(_, _, body)| !body.0.is_empty())
        .collect();
    let body = html! {
        header {
            h1 { "Identification of " (name) }
            p.soft {
                "plychain " (page.manifest.version) ", seed " (page.report.seed) ", "
                (page.manifest.inputs_sha256.len()) " input files"
            }
            (sections::verdict(page))
            nav aria-label="Sections" { ul {
                @for (id, title, _) in &present { li { a href={ "#" (id) } { (title) } } }
            } }
        }
        main {
            @for (id, title, body) in &present {
                section id=(id) { h2 { (title) } (body) }
            }
        }
        footer.soft { "Units stand in the names: GPa, mm, \u{b5}m, nm. Intervals hold 95 % of the posterior." }
    };
    document(&format!("{name}: plychain report"), &body)
}

/// All experiments, where there are several.
fn together(page: &Page) -> Markup {
    let report = &page.report;
    let together = report.together.as_ref();
    together.map_or_else(|| html! {}, |t| t.section(&report.both()))
}

/// A figure that scales with the page.
pub fn figure(figure: &Figure) -> Markup {
    html! { figure { (PreEscaped(figure.inline())) } }
}

/// A figure that keeps its size, and scrolls where there is no room, with a caption.
fn wide(figure: &Figure) -> Markup {
    html! {
        figure {
            div.scroll tabindex="0" role="group" aria-label=(figure.alt) { (PreEscaped(figure.inline())) }
            figcaption { (figure.alt) "." }
        }
    }
}

/// A column with a longer cell is one of text: broken into lines, and to the left.
const LONG: usize = 28;

/// A table: its caption, header and rows; the first column holds the rows' names.
pub fn table(
    caption: &str,
    header: &[impl AsRef<str>],
    rows: impl IntoIterator<Item = Vec<String>>,
    sortable: bool,
) -> Markup {
    let rows: Vec<_> = rows.into_iter().collect();
    let long = |k: usize| {
        let mut cells = rows.iter().filter_map(|row| row.get(k));
        k > 0 && cells.any(|cell| cell.chars().count() > LONG)
    };
    let long: Vec<bool> = (0..header.len()).map(long).collect();
    html! {
        div.scroll tabindex="0" role="group" aria-label=(caption) {
            table.sortable[sortable] {
                caption { span { (caption) } }
                thead { tr {
                    @for (h, long) in header.iter().zip(&long) {
                        th.long[*long] scope="col" { (h.as_ref()) }
                    }
                } }
                tbody {
                    @for row in &rows {
                        tr {
                            @for (k, cell) in row.iter().enumerate() {
                                @if k == 0 { th scope="row" { (cell) } }
                                @else if long.get(k) == Some(&true) { td.long { (cell) } }
                                @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A plain table, the first cell of a row its name.
pub fn rows_of(header: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { @for cell in header { th { (cell) } } } }
            tbody { @for row in rows { tr { @for (k, cell) in row.iter().enumerate() {
                @if k == 0 { th { (cell) } } @else { td { (cell) } }
            } } } }
        } }
    }
}

/// What stands where there is no number.
const DASH: &str = "\u{2013}";

/// A number with three digits after the point or three significant ones.
fn short(value: impl Into<Option<f64>>) -> String {
    match value.into().filter(|v| v.is_finite()) {
        None => DASH.into(),
        Some(0.0) => "0".into(),
        Some(v) if v.abs() >= 1e5 || v.abs() < 1e-3 => minus(&format!("{v:.2e}")),
        Some(v) => {
            let decimals = (2.0 - v.abs().log10().floor()).clamp(0.0, 6.0) as usize;
            minus(&format!("{v:.decimals$}"))
        }
    }
}

/// A number with so many decimals.
fn fixed(value: Option<f64>, decimals: usize) -> String {
    value.map_or(DASH.into(), |v| minus(&format!("{v:.decimals$}")))
}

/// A value with as many decimals as its sd asks for.
fn with_sd(value: f64, sd: f64) -> String {
    minus(&significant(value, sd))
}

fn mean_sd(moments: Option<(f64, f64)>) -> String {
    moments.map_or(DASH.into(), |(mean, sd)| {
        format!("{} \u{b1} {}", with_sd(mean, sd), with_sd(sd, sd))
    })
}

fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

fn row(name: impl Into<String>, cells: impl IntoIterator<Item = String>) -> Vec<String> {
    once(name.into()).chain(cells).collect()
}
