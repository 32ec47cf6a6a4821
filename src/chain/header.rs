//! The header of a file of draws, and the cells of its rows.

use std::collections::HashSet;

use super::columns::{CHAIN, is_draw, role};
use crate::error::{Error, Result};
use crate::files;

/// The cells of a line, without blanks and quotation marks; no sign is any number of blanks.
fn cells(line: &str, sign: Option<char>) -> Vec<&str> {
    let ends = |c: char| sign.map_or(c.is_whitespace(), |sign| c == sign);
    let cells = files::cells(line, ends).map(|f| f.trim().trim_matches('"'));
    cells.filter(|f| sign.is_some() || !f.is_empty()).collect()
}

/// The header of a file: its columns, and what stands between the cells.
pub(super) struct ChainHeader {
    pub columns: Vec<String>,
    sign: Option<char>,
    pub chain: Option<usize>,
    /// Whether no row was read yet.
    is_first: bool,
}

/// What stands between the cells of a line; none is any number of blanks.
fn sign_of(line: &str) -> Option<char> {
    let splits = |s: &char| cells(line, Some(*s)).len() > 1;
    [',', ';', '\t'].into_iter().find(splits)
}

/// A number as programs write it, or whether something is so (pandas, R, Julia).
pub(super) fn number(field: &str) -> Option<f64> {
    let of_word = |(word, value): (&str, f64)| field.eq_ignore_ascii_case(word).then_some(value);
    let words = [("true", 1.0), ("false", 0.0)].into_iter();
    field
        .parse()
        .ok()
        .or_else(|| words.filter_map(of_word).next())
}

impl ChainHeader {
    /// The header in a file's first line, and whether that is a row already: the names then stand in the comment before it.
    pub fn before(line: &str, comment: &str) -> Result<(Self, bool)> {
        let row = cells(line, sign_of(line));
        let names = cells(comment, sign_of(comment));
        if names.len() == row.len() && row.iter().all(|cell| number(cell).is_some()) {
            return Ok((Self::new(comment, sign_of(line))?, true));
        }
        Ok((Self::new(line, sign_of(line))?, false))
    }

    /// The names in a line, of rows with a sign between the cells.
    fn new(line: &str, sign: Option<char>) -> Result<Self> {
        let columns = cells(line, sign_of(line));
        let columns: Vec<String> = columns.into_iter().map(String::from).collect();
        check_header(&columns)?;
        Ok(Self {
            chain: columns.iter().position(|c| CHAIN.contains(&c.as_str())),
            columns,
            sign,
            is_first: true,
        })
    }

    /// The cells of a row. Names of rows, as R writes them, have no name of their own.
    pub fn row<'a>(&mut self, line: &'a str) -> Result<Vec<&'a str>> {
        let row = cells(line, self.sign);
        let beside = row.len() == self.columns.len() + 1;
        if beside && self.sign.is_none() && std::mem::take(&mut self.is_first) {
            self.columns.insert(0, String::new());
            self.chain = self.chain.map(|at| at + 1);
        }
        self.is_first = false;
        let wanted = self.columns.len();
        if row.len() == wanted {
            return Ok(row);
        }
        Err(Error::input("row", format!("{wanted} columns"))
            .found(format!("{} columns", row.len()))
            .hint("the last line of a chain that was killed may be cut: remove it"))
    }

    /// Whether a column is a number of every draw, not the name of a row or a chain.
    pub fn is_read(&self, at: usize) -> bool {
        Some(at) != self.chain && !(at == 0 && self.columns[0].is_empty())
    }
}

fn check_header(fields: &[String]) -> Result<()> {
    let mut known = HashSet::new();
    for (at, field) in fields.iter().enumerate() {
        if (field.is_empty() && at > 0) || field.parse::<f64>().is_ok() {
            return Err(Error::input(
                format!("column {}", at + 1),
                "the name of a column (the first line that is no comment is the header)",
            )
            .found(field)
            .hint("write the names as the first line, such as E1_GPa,nu12"));
        }
        if !known.insert(field) {
            return Err(Error::input(format!("column {}", at + 1), "each name once").found(field));
        }
    }
    let is_parameter = |(at, f): (usize, &String)| {
        let counts = CHAIN.contains(&f.as_str()) || is_draw(at, f);
        role(f, fields).is_none() && !f.is_empty() && !counts
    };
    if !fields.iter().enumerate().any(is_parameter) {
        return Err(Error::input("header", "at least one parameter").found(fields.join(",")));
    }
    Ok(())
}
