//! An input file line by line: keywords open blocks, data lines fill them, included files are read in place.

use std::path::{Path, PathBuf};

use super::super::draft::{Draft, FileSpot};
use super::elements::Type;
use super::keyword::Keyword;
use super::sets::{SetScope, Sets};
use crate::error::{Error, Result};

/// How deep included files may include others.
const DEEPEST: usize = 8;

/// A line of `*SURFACE`: what it names (a set or a number) and which side of it.
#[derive(Debug)]
pub(super) struct DeckPatch {
    pub target: String,
    pub side: String,
    pub spot: FileSpot,
}

/// A named surface.
#[derive(Debug)]
pub(super) struct DeckSurface {
    pub name: String,
    pub scope: SetScope,
    pub is_internal: bool,
    pub is_of_nodes: bool,
    pub patches: Vec<DeckPatch>,
}

/// What the data lines belong to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) enum ElementBlock {
    /// To nothing that is read.
    #[default]
    Other,
    /// Nodes, which a set has.
    Nodes(Option<usize>),
    /// Elements, which a set has.
    Elements(Type, Option<usize>),
    /// Elements without area, of the part or not.
    LeftOut(bool),
    Set(SetLines),
    Surface(usize),
    /// To the instance, with the number of its data lines so far.
    Instance(usize),
}

/// How the lines of a set are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct SetLines {
    pub is_of_nodes: bool,
    pub index: usize,
    pub generate: bool,
    /// Numbers are those of an assembly's own reference points, which no element uses.
    pub is_foreign: bool,
}

/// What was opened and is not closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Open {
    Part,
    Assembly,
    Instance,
}

/// What has been read.
#[derive(Debug, Default)]
pub(super) struct Deck {
    pub draft: Draft,
    pub node_sets: Sets,
    pub element_sets: Sets,
    pub surfaces: Vec<DeckSurface>,
    /// Keys of the names of the part and the instance.
    pub prefixes: Vec<String>,
    /// The instance's name, which goes before a part's ambiguous names.
    pub instance: Option<String>,
    pub parts: usize,
    pub open: Vec<Open>,
    pub block: ElementBlock,
    /// A keyword line that goes on.
    keyword: String,
    /// Numbers of an element that goes on.
    pub element: Vec<u64>,
    /// The type of elements without area, until it is said that they are left out.
    pub left_out: Option<String>,
    pub translation: [f64; 3],
    /// The present file and line.
    pub spot: FileSpot,
}

impl Deck {
    /// Read a file, `depth` files below the first one.
    pub fn read(&mut self, bytes: &[u8], path: &Path, depth: usize) -> Result<()> {
        let outer = self.spot;
        self.draft.files.push(path.to_path_buf());
        self.spot.file = (self.draft.files.len() - 1) as u32;
        for (at, line) in (1..).zip(bytes.split(|b| *b == b'\n')) {
            self.spot.line = at;
            let line = String::from_utf8_lossy(line.trim_ascii());
            self.line(&line, path, depth)?;
        }
        // a keyword that goes on ends with its file
        self.close_keyword(path, depth)?;
        if depth == 0 {
            self.close_block()?;
        }
        self.spot = outer;
        Ok(())
    }

    /// Check that everything is closed, and move the part.
    pub fn end(mut self) -> Result<Self> {
        if let Some(open) = self.open.last() {
            let name = format!("*END {}", format!("{open:?}").to_uppercase());
            return Err(Error::input(self.draft.file(0), name)
                .found("the end of the file")
                .hint("the file is cut short: write or copy it again"));
        }
        for node in &mut self.draft.nodes {
            for (x, t) in node.at.iter_mut().zip(self.translation) {
                *x += t;
            }
        }
        Ok(self)
    }

    /// The present file and line.
    pub fn place(&self) -> String {
        self.draft.place(self.spot)
    }

    /// An error of the input at the present line.
    pub fn error(&self, expected: impl std::fmt::Display) -> Error {
        Error::input(self.place(), expected)
    }

    fn line(&mut self, line: &str, path: &Path, depth: usize) -> Result<()> {
        if line.is_empty() || line.starts_with("**") {
            return Ok(());
        }
        if !self.keyword.is_empty() && !line.starts_with('*') {
            self.keyword.push_str(line);
        } else if line.starts_with('*') {
            self.close_keyword(path, depth)?;
            self.keyword.push_str(line);
        } else {
            return self.data(line);
        }
        if line.ends_with(',') {
            return Ok(());
        }
        self.close_keyword(path, depth)
    }

    fn close_keyword(&mut self, path: &Path, depth: usize) -> Result<()> {
        if self.keyword.is_empty() {
            return Ok(());
        }
        let keyword = Keyword::of(&std::mem::take(&mut self.keyword));
        if keyword.name != "INCLUDE" {
            self.close_block()?;
            self.open_block(&keyword)?;
        }
        let has_data = !matches!(self.block, ElementBlock::Other | ElementBlock::Instance(_));
        if keyword.name == "INCLUDE" || (has_data && keyword.has("INPUT")) {
            let input = keyword.need("INPUT", || self.place())?.to_string();
            self.include(&input, path, depth)?;
        }
        Ok(())
    }

    fn include(&mut self, input: &str, path: &Path, depth: usize) -> Result<()> {
        let file: PathBuf = path.parent().unwrap_or(Path::new("")).join(input);
        if depth >= DEEPEST || self.draft.files.contains(&file) {
            let expected = format!("every file included once, at most {DEEPEST} files deep");
            return Err(self.error(expected).found(file.display()));
        }
        let bytes = super::super::file::load(&file).map_err(|e| e.within(self.place()))?;
        self.read(&bytes, &file, depth + 1)
    }

    /// End the block of data lines.
    fn close_block(&mut self) -> Result<()> {
        if let (ElementBlock::Elements(kind, _), false) = (&self.block, self.element.is_empty()) {
            let expected = format!("an element's number and {} nodes", kind.nodes());
            let found = format!("only {} numbers", self.element.len());
            return Err(self
                .error(expected)
                .found(found)
                .hint("the line above is cut short: write the file again"));
        }
        self.element.clear();
        self.block = ElementBlock::Other;
        Ok(())
    }
}
