//! Sections on a terminal: aligned columns, running text in lines of a hundred characters, no figures.

use super::{Piece, Section, Table};

/// Width of running text.
const COLUMNS: usize = 100;

/// The parts of sections one below the other, a blank line before whatever is not text that goes on.
pub fn terminal(sections: &[Section]) -> String {
    let mut text = String::new();
    for section in sections {
        heading(&mut text, &section.title);
        let mut after_text = false;
        for piece in &section.pieces {
            let shown = shown(piece);
            let is_text = matches!(piece, Piece::Paragraph(_) | Piece::Note(_) | Piece::List(_));
            let follows_on = after_text && is_text;
            if !shown.is_empty() && !follows_on {
                blank_line(&mut text);
            }
            after_text = if shown.is_empty() {
                after_text
            } else {
                is_text
            };
            text += &shown;
        }
    }
    text
}

fn heading(text: &mut String, title: &str) {
    if !title.is_empty() {
        blank_line(text);
        *text += &wrap("", "", title);
    }
}

fn blank_line(text: &mut String) {
    text.push('\n');
}

fn shown(piece: &Piece) -> String {
    match piece {
        Piece::Figure { .. } | Piece::Gallery { .. } => String::new(),
        Piece::Columns(left, right) => left.iter().chain(right).map(shown).collect(),
        Piece::Heading(text) | Piece::Paragraph(text) | Piece::Note(text) if text.is_empty() => {
            String::new()
        }
        Piece::Heading(text) | Piece::Paragraph(text) | Piece::Note(text) => wrap("", "", text),
        Piece::List(items) => {
            let item = |(lead, text): &(String, String)| match lead.is_empty() {
                true => wrap("  ", "  ", text),
                false => wrap("  ", "    ", &format!("{lead}: {text}")),
            };
            items.iter().map(item).collect()
        }
        Piece::Warnings(warnings) if warnings.is_empty() => String::new(),
        Piece::Warnings(warnings) => {
            let items = warnings.iter().map(|w| wrap("  - ", "    ", w));
            format!(
                "BEFORE YOU USE THESE NUMBERS\n{}",
                items.collect::<String>()
            )
        }
        Piece::Verdict { word, text, .. } => wrap("", "", &format!("VERDICT: {word}. {text}")),
        Piece::Table(table) if table.is_empty() => String::new(),
        Piece::Table(table) => match table.caption.is_empty() {
            true => aligned(table),
            false => format!("{}\n{}", wrap("", "", &table.caption), aligned(table)),
        },
    }
}

/// Aligned columns: the first to the left, the others to the right.
fn aligned(table: &Table) -> String {
    let plain = |row: &Vec<super::TableCell>| row.iter().map(super::TableCell::plain).collect();
    let lines: Vec<Vec<String>> = std::iter::once(table.header.clone())
        .chain(table.rows.iter().map(plain))
        .collect();
    let length = |cell: &String| cell.chars().count();
    let width = |k: usize| lines.iter().map(|line| length(&line[k])).max().unwrap_or(0);
    let widths: Vec<usize> = (0..table.header.len()).map(width).collect();
    let line = |cells: &Vec<String>| {
        let padded = cells.iter().zip(&widths).enumerate();
        let padded = padded.map(|(k, (cell, width))| match k {
            0 => format!("  {cell:<width$}"),
            _ => format!("  {cell:>width$}"),
        });
        padded.collect::<String>().trim_end().to_string() + "\n"
    };
    lines.iter().map(line).collect()
}

/// Break a text into lines of at most a hundred characters, the first after `first`, the others after `next`.
pub fn wrap(first: &str, next: &str, text: &str) -> String {
    let mut wrapped = String::new();
    let mut line = first.to_string();
    let mut empty = true;
    for word in text.split_whitespace() {
        if !empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            wrapped += &(line + "\n");
            line = next.to_string();
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line += word;
        empty = false;
    }
    wrapped + &line + "\n"
}
