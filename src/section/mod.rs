//! What a report is made of: sections of paragraphs, lists, tables and figures. The renderers alone know how these look on a terminal,
//! on a page and as CSV.

mod cell;
mod csv;
mod table;
mod terminal;

pub use cell::{Digits, TableCell, typeset};
pub use csv::csv;
pub use table::{Table, row};
pub use terminal::{terminal, wrap};

use serde::{Deserialize, Serialize};

/// A piece of a section.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Piece {
    Heading(String),
    Paragraph(String),
    /// A remark in small print.
    Note(String),
    /// Items, each after a lead that names it, which may be empty.
    List(Vec<(String, String)>),
    /// What should be known before the numbers are used.
    Warnings(Vec<String>),
    /// The answer of a run in a word, the sentences after it, and whether something is left to do.
    Verdict {
        word: String,
        text: String,
        open: bool,
    },
    Table(Table),
    /// A figure by its name under a heading, which may be empty; nothing where there is no such figure.
    Figure {
        heading: String,
        name: String,
    },
    /// Two columns side by side, one below the other where there is no room.
    Columns(Vec<Piece>, Vec<Piece>),
    /// Figures by their names, side by side; nothing where there is none of them.
    Gallery {
        heading: String,
        names: Vec<String>,
    },
}

impl Piece {
    pub fn figure(name: impl Into<String>) -> Self {
        Self::Figure {
            heading: String::new(),
            name: name.into(),
        }
    }

    pub fn list(items: impl IntoIterator<Item = String>) -> Self {
        let unnamed = |text| (String::new(), text);
        Self::List(items.into_iter().map(unnamed).collect())
    }
}

impl From<Table> for Piece {
    fn from(table: Table) -> Self {
        Self::Table(table)
    }
}

/// Pieces under one title.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Section {
    pub title: String,
    pub pieces: Vec<Piece>,
}

impl Section {
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            pieces: Vec::new(),
        }
    }

    /// The section with a piece more.
    pub fn with(mut self, piece: impl Into<Piece>) -> Self {
        self.push(piece);
        self
    }

    /// The section with a paragraph more; an empty one is none.
    pub fn say(self, text: impl Into<String>) -> Self {
        self.with(Piece::Paragraph(text.into()))
    }

    /// The section with pieces more.
    pub fn with_all(mut self, pieces: impl IntoIterator<Item = Piece>) -> Self {
        self.extend(pieces);
        self
    }

    pub fn push(&mut self, piece: impl Into<Piece>) {
        self.pieces.push(piece.into());
    }

    pub fn extend(&mut self, pieces: impl IntoIterator<Item = Piece>) {
        self.pieces.extend(pieces);
    }

    /// What links lead to on a page.
    pub fn id(&self) -> String {
        let plain = |c: char| match c {
            c if c.is_alphanumeric() => c.to_ascii_lowercase(),
            _ => '-',
        };
        self.title.chars().map(plain).collect()
    }
}

/// A whole page: its title, what stands above the sections, the sections, and the line below them.
#[derive(Debug, Default)]
pub struct Document {
    pub title: String,
    /// The heading of the page.
    pub heading: String,
    pub lead: Vec<Piece>,
    pub sections: Vec<Section>,
    /// Whether a section shows its title alone until it is opened.
    pub folded: bool,
    pub footer: String,
}
