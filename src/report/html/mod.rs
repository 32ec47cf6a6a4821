//! Sections as a page: one file that needs nothing else, for a screen and for paper.

use maud::{DOCTYPE, Markup, PreEscaped, html as markup};

use super::figures::Figure;
use crate::section::{Document, Piece, Table, TableCell, typeset};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// Sections that paper shows only where they were opened.
const APPENDIX: [&str; 4] = [
    "What you told the program",
    "Effects",
    "Blind spots",
    "Convergence",
];

/// Nothing but what the page itself carries may be loaded.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// A whole page with its figures. Sections in which nothing is shown are left out.
pub fn html(document: &Document, figures: &[Figure]) -> String {
    let sections = document.sections.iter();
    let sections = sections.map(|section| (section, all(&section.pieces, figures)));
    let present: Vec<_> = sections.filter(|(_, body)| !body.0.is_empty()).collect();
    markup! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                link rel="icon" href="data:,";
                title { (document.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (document.heading) }
                    (all(&document.lead, figures))
                    @if present.len() > 1 && !document.folded {
                        nav aria-label="Sections" { ul {
                            @for (section, _) in &present { li { a href={ "#" (section.id()) } { (section.title) } } }
                        } }
                    }
                }
                main {
                    @for (section, body) in &present {
                        @if document.folded {
                            details.appendix[APPENDIX.contains(&&*section.title)] id=(section.id()) { summary { h2 { (section.title) } } (body) }
                        } @else {
                            section id=(section.id()) { h2 { (section.title) } (body) }
                        }
                    }
                }
                footer.soft { (document.footer) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

fn all(pieces: &[Piece], figures: &[Figure]) -> Markup {
    markup! { @for shown in pieces { (piece(shown, figures)) } }
}

fn piece(piece: &Piece, figures: &[Figure]) -> Markup {
    let drawn = |name: &String| figures.iter().find(|figure| figure.name == *name);
    match piece {
        Piece::Heading(text) if text.is_empty() => markup! {},
        Piece::Paragraph(text) | Piece::Note(text) if text.is_empty() => markup! {},
        Piece::Heading(text) => markup! { h3 { (capital(text)) } },
        Piece::Paragraph(text) => markup! { p { (sentence(text)) } },
        Piece::Note(text) => markup! { p.soft { (sentence(text)) } },
        Piece::List(items) if items.is_empty() => markup! {},
        Piece::List(items) => markup! {
            ul.warnings { @for (lead, text) in items { li {
                @if !lead.is_empty() { strong { (lead) } ": " }
                (sentence(text))
            } } }
        },
        Piece::Warnings(warnings) if warnings.is_empty() => markup! {},
        Piece::Warnings(warnings) => markup! {
            h3 { "Before you use these numbers" }
            ul.warnings { @for warning in warnings { li { (sentence(warning)) } } }
        },
        Piece::Verdict { word, text, open } => markup! {
            p.verdict.open[*open] {
                @if !word.is_empty() { strong { (capital(word)) ". " } }
                (sentence(text))
            }
        },
        Piece::Columns(left, right) => markup! {
            div.columns { div { (all(left, figures)) } div { (all(right, figures)) } }
        },
        Piece::Table(shown) if shown.is_empty() => markup! {},
        Piece::Table(shown) => table(shown),
        Piece::Figure { heading, name } => markup! {
            @if let Some(figure) = drawn(name) {
                @if !heading.is_empty() { h3 { (capital(heading)) } }
                (wide(figure))
            }
        },
        Piece::Gallery { heading, names } => {
            let shown: Vec<&Figure> = names.iter().filter_map(drawn).collect();
            markup! {
                @if !shown.is_empty() {
                    @if !heading.is_empty() { h3 { (capital(heading)) } }
                    div.maps { @for figure in shown { figure { (PreEscaped(figure.inline())) } } }
                }
            }
        }
    }
}

/// A figure that keeps its size, and scrolls where there is no room, with a caption.
fn wide(figure: &Figure) -> Markup {
    markup! {
        figure {
            div.scroll tabindex="0" role="group" aria-label=(figure.alt) { (PreEscaped(figure.inline())) }
            figcaption { (figure.alt) "." }
        }
    }
}

/// A sentence whose options (`--resume`) are not broken at their hyphens.
fn sentence(text: &str) -> Markup {
    markup! {
        @for word in typeset(text).split_inclusive(' ') {
            @if word.starts_with("--") { span.option { (word) } } @else { (word) }
        }
    }
}

/// A text that begins a sentence.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// A column with a longer cell is one of text: broken into lines, and to the left.
const LONG: usize = 28;

fn table(table: &Table) -> Markup {
    let cells = |row: &Vec<TableCell>| row.iter().map(TableCell::typeset).collect();
    let rows: Vec<Vec<String>> = table.rows.iter().map(cells).collect();
    let is_long = |k: usize| k > 0 && rows.iter().any(|row| row[k].chars().count() > LONG);
    let long: Vec<bool> = (0..table.header.len()).map(is_long).collect();
    let caption = typeset(&capital(&table.caption));
    markup! {
        div.scroll tabindex="0" role="group" aria-label=(caption) {
            table class=[table.sortable.then_some("sortable")] {
                @if !caption.is_empty() { caption { span { (caption) } } }
                thead { tr {
                    @for (head, long) in table.header.iter().zip(&long) {
                        th class=[long.then_some("long")] scope="col" { (head) }
                    }
                } }
                tbody {
                    @for row in &rows {
                        tr {
                            @for (k, (cell, long)) in row.iter().zip(&long).enumerate() {
                                @if k == 0 { th scope="row" { (cell) } }
                                @else { td class=[long.then_some("long")] { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
