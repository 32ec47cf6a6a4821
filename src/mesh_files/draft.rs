//! What a mesh file says, in its own numbers, before anything is checked.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::kind::ElementKind;
use crate::error::{Error, Result};

/// Where something stands: a file by its index, and its line from 1 on; 0 in a binary file.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FileSpot {
    pub file: u32,
    pub line: u32,
}

/// A node by its number in the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct DraftNode {
    pub number: u64,
    pub at: [f64; 3],
    pub spot: FileSpot,
}

/// An element by its number in the file; places that its kind does not have hold [`Cell::NONE`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub number: u64,
    pub kind: ElementKind,
    pub nodes: [u64; 8],
    /// Whether its sides go by the names of shells and membranes of Abaqus.
    pub is_shell: bool,
    pub spot: FileSpot,
}

impl Cell {
    pub const NONE: u64 = u64::MAX;

    pub fn nodes(&self) -> &[u64] {
        &self.nodes[..self.kind.nodes()]
    }
}

/// A line element, which only names a part of the boundary: two or three nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct DraftLine {
    pub number: u64,
    pub nodes: [u64; 3],
    pub spot: FileSpot,
}

/// All of it.
#[derive(Debug, Default)]
pub(super) struct Draft {
    pub files: Vec<PathBuf>,
    pub nodes: Vec<DraftNode>,
    pub cells: Vec<Cell>,
    pub lines: Vec<DraftLine>,
    /// Numbers of elements that have no area and are left out.
    pub left_out: BTreeSet<u64>,
    pub remarks: Vec<String>,
}

impl Draft {
    /// File and line.
    pub fn place(&self, spot: FileSpot) -> String {
        let file = self.file(spot.file);
        match spot.line {
            0 => file,
            line => format!("{file}:{line}"),
        }
    }

    /// A file's name.
    pub fn file(&self, index: u32) -> String {
        let file = self.files.get(index as usize);
        file.map_or_else(|| "mesh".to_string(), |f| f.display().to_string())
    }

    /// File, line and number of an element by its index.
    pub fn place_of_cell(&self, index: usize) -> String {
        let cell = &self.cells[index];
        format!("{}: element {}", self.place(cell.spot), cell.number)
    }

    /// File, line and number of a node by its index.
    pub fn place_of_node(&self, index: usize) -> String {
        let node = &self.nodes[index];
        format!("{}: node {}", self.place(node.spot), node.number)
    }
}

/// Numbers of a file in increasing order, each with its index.
#[derive(Debug, Default)]
pub(super) struct Index(Vec<(u64, u32)>);

impl Index {
    /// Of numbers in the order of their indices. If two are equal, the index of the later one.
    pub fn new(numbers: impl Iterator<Item = u64>) -> std::result::Result<Self, usize> {
        let mut sorted: Vec<(u64, u32)> = (0u32..).zip(numbers).map(|(i, n)| (n, i)).collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|w| w[0].0 == w[1].0) {
            Some(pair) => Err(pair[1].1 as usize),
            None => Ok(Self(sorted)),
        }
    }

    /// The index of a number.
    pub fn get(&self, number: u64) -> Option<u32> {
        let at = self.0.binary_search_by_key(&number, |(n, _)| *n).ok()?;
        Some(self.0[at].1)
    }

    /// Those from `first` to `last`.
    pub fn range(&self, first: u64, last: u64) -> &[(u64, u32)] {
        let from = self.0.partition_point(|(n, _)| *n < first);
        let to = self.0.partition_point(|(n, _)| *n <= last);
        self.0.get(from..to).unwrap_or(&[])
    }
}

/// How many members the groups of a file may have together: a short file can put everything into thousands of groups.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Allowance {
    taken: usize,
}

impl Allowance {
    /// Members that any file may have.
    const ALWAYS: usize = 10_000;
    /// Groups that every node and element may be in, on average: plies of a thick laminate each have a set of all elements.
    const EACH: usize = 100;

    /// Count further members of a file that has `size` nodes and elements.
    ///
    /// # Errors
    /// The input's fault, at `place`, if there are too many.
    pub fn take(&mut self, count: usize, size: usize, place: impl Fn() -> String) -> Result<()> {
        self.taken = self.taken.saturating_add(count);
        if self.taken <= Self::ALWAYS + Self::EACH * size {
            return Ok(());
        }
        Err(Error::input(
            place(),
            format!(
                "at most {} groups or sets for a node or element, on average",
                Self::EACH
            ),
        )
        .found("more")
        .hint("delete the groups or sets that the model file does not name"))
    }
}
