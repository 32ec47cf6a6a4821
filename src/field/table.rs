//! A table with named columns, as programs for digital image correlation export it: comma, semicolon or tab
//! separated, `#` starts a comment line, failed points have empty or NaN cells.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, StringRecord, Trim};

use super::frame::Frame;
use super::grid::Grid;
use super::measured::{Field, Rejected};
use super::reader::{
    ColumnMap, Columns, LEAST_CORRELATION, Reader, Units, number, read_text, unwritable,
};
use super::row::{Point, Row};
use crate::error::{Error, Result};
use crate::quantity::UM_PER_MM;

/// The reader of this format.
pub struct Csv;

impl Reader for Csv {
    fn format(&self) -> &'static str {
        "csv"
    }

    fn is_directory(&self) -> bool {
        false
    }

    fn file_name(&self) -> &'static str {
        "field.csv"
    }

    fn has_columns(&self) -> bool {
        true
    }

    fn files(&self, path: &Path) -> Vec<PathBuf> {
        vec![path.to_owned()]
    }

    fn read(&self, path: &Path, columns: Option<&ColumnMap>, frame: Frame) -> Result<Field> {
        let columns = columns.ok_or_else(|| Error::program("field::table", "declared columns"))?;
        read(path, columns, frame)
    }

    /// One row a point, failed ones with empty cells.
    fn write(&self, path: &Path, grid: &Grid, frame: Frame) -> Result<Option<ColumnMap>> {
        let mut text = String::from("x_mm,y_mm,ux_um,uy_um\n");
        for (p, u) in grid.points.iter().zip(&grid.displacement) {
            let [ux, uy] = frame.vector(*u).map(|u| u * UM_PER_MM);
            // writing to a String cannot fail
            let _ = if ux.is_finite() && uy.is_finite() {
                writeln!(text, "{:.5},{:.5},{ux:.6},{uy:.6}", p[0], p[1])
            } else {
                writeln!(text, "{:.5},{:.5},,", p[0], p[1])
            };
        }
        std::fs::write(path, text).map_err(|e| unwritable(path, &e))?;
        Ok(Some(ColumnMap {
            columns: Columns::new(["x_mm", "y_mm", "ux_um", "uy_um"].map(String::from)),
            units: Units::new("mm", "um"),
        }))
    }
}

/// Read the columns of the file `path` as a field in `frame`.
///
/// # Errors
/// Of the input: a missing, empty or non-text file, an unknown or repeated column (with the columns there are), a
/// row of another length or a cell that is not a number (with line and column), two displacements of one point, no measured point, a correlation that is
/// below [`LEAST_CORRELATION`] nearly everywhere.
pub fn read(path: &Path, map: &ColumnMap, frame: Frame) -> Result<Field> {
    let text = read_text(path)?;
    let (mut reader, headers) = opened(path, &text)?;
    if headers.is_empty() {
        return Err(
            Error::input(path.display(), "a header line and rows of numbers")
                .found("an empty file"),
        );
    }
    let row = Row::new(path, map, &headers)?;
    let mut field = Field {
        points: Vec::new(),
        displacement: Vec::new(),
        sigma: row.keeps_sigma().then(Vec::new),
        frame,
        grid: None,
        rejected: Rejected::default(),
        outlying: Vec::new(),
        fringe_frequency_per_mm: None,
        subset_mm: None,
        files: vec![path.to_owned()],
    };
    let mut faint = 0;
    let mut known = KnownColumns::default();
    let mut record = StringRecord::new();
    while reader
        .read_record(&mut record)
        .map_err(|e| Error::input(path.display(), "rows of text").found(e))?
    {
        let byte = record.position().map_or(0, csv::Position::byte);
        let line = |byte| format!("{}:{}", path.display(), line_at(&text, byte));
        let place = || line(byte);
        if record.len() != headers.len() {
            let expected = format!("{} cells as in the header", headers.len());
            return Err(Error::input(place(), expected).found(format!("{} cells", record.len())));
        }
        match row.point(&record, &place)? {
            Point::Missing => field.rejected.missing += 1,
            Point::Failed => field.rejected.uncorrelated += 1,
            Point::Faint => faint += 1,
            Point::Measured { at, u, .. } if known.has(at, (u, byte), &line)? => {
                field.rejected.repeated += 1;
            }
            Point::Measured { at, u, sigma } => {
                field.points.push(frame.point(at));
                field.displacement.push(frame.vector(u));
                if let Some(all) = &mut field.sigma {
                    all.push(sigma);
                }
            }
        }
    }
    field.rejected.uncorrelated += faint;
    check_measured(path, map, &field, faint)?;
    Ok(field)
}

/// The points of a table so far, by the bits of their coordinates: what was measured there, and at which byte of the file.
#[derive(Default)]
struct KnownColumns(HashMap<[u64; 2], ([f64; 2], u64)>);

impl KnownColumns {
    /// Whether a row at some byte of the file stands in the table already.
    ///
    /// # Errors
    /// The input's fault: another displacement at the same point.
    fn has(
        &mut self,
        at: [f64; 2],
        (u, byte): ([f64; 2], u64),
        line: &dyn Fn(u64) -> String,
    ) -> Result<bool> {
        // 0 is added to make one of both zeros
        let key = at.map(|x| (x + 0.0).to_bits());
        let (same, first) = *self.0.entry(key).or_insert((u, byte));
        if same != u {
            return Err(Error::input(line(byte), "one displacement of every point")
                .found(format!("another one of the point of {}", line(first)))
                .hint("are these two steps, or two regions that overlap, in one file? give each step a file of its own, and export each point once"));
        }
        Ok(first != byte)
    }
}

/// Something was measured, and little of it is `faint`.
fn check_measured(path: &Path, map: &ColumnMap, field: &Field, faint: usize) -> Result<()> {
    if faint > field.len() {
        return Err(faint_everywhere(path, map, [faint, field.len()]));
    }
    if !field.is_empty() {
        return Ok(());
    }
    let Rejected {
        missing,
        uncorrelated,
        ..
    } = field.rejected;
    let found = match uncorrelated {
        0 => format!("{missing} rows, none complete"),
        _ => format!("{missing} rows not complete, {uncorrelated} not correlated"),
    };
    Err(Error::input(path.display(), "at least one measured point").found(found))
}

/// Most of the points have a small correlation: it is rather another measure than a bad picture.
fn faint_everywhere(path: &Path, map: &ColumnMap, [faint, left]: [usize; 2]) -> Error {
    let name = map.columns.correlation.as_deref().unwrap_or_default();
    let expected = format!(
        "correlation coefficients, 1 for a perfect match, of at least {LEAST_CORRELATION} for half of the points"
    );
    let place = format!("{}, column \"{name}\"", path.display());
    Error::input(place, expected)
        .found(format!("smaller ones at {faint} of {} points", faint + left))
        .hint("a residual of the correlation (ZNSSD, gamma), 0 for a perfect match, is no coefficient: leave columns.correlation out")
}

/// The column names of a table.
///
/// # Errors
/// Of the input: a missing, empty or non-text file.
pub fn header(path: &Path) -> Result<Vec<String>> {
    let text = read_text(path)?;
    let (_, headers) = opened(path, &text)?;
    Ok(headers.iter().map(String::from).collect())
}

/// The force that the comments before the first row of a table state (ARAMIS: `# force : 15000`), N; without a unit it is
/// taken for newtons.
///
/// # Errors
/// Of the input: a missing or non-text file.
pub fn stated_force(path: &Path) -> Result<Option<f64>> {
    let text = read_text(path)?;
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
    let comments = lines.map_while(|l| l.strip_prefix('#'));
    Ok(comments.filter_map(force_in).next())
}

/// The force of a comment `force [kN] : 1.5`, `Force = 1500 N`.
fn force_in(comment: &str) -> Option<f64> {
    let comment = comment.to_lowercase();
    let (key, value) = comment.split_once([':', '='])?;
    let words = |text: &str| -> Vec<String> {
        let words = text.split(|c: char| c.is_whitespace() || "[]()_".contains(c));
        words.filter(|w| !w.is_empty()).map(String::from).collect()
    };
    let (key, value) = (words(key), words(value));
    if key.first()? != "force" {
        return None;
    }
    let size = number(value.first()?).filter(|f| f.is_finite())?;
    let newtons: Option<Vec<f64>> = key[1..]
        .iter()
        .chain(&value[1..])
        .map(|unit| match unit.as_str() {
            "n" => Some(1.0),
            "kn" => Some(1e3),
            "mn" => Some(1e6),
            _ => None,
        })
        .collect();
    Some(size * newtons?.first().unwrap_or(&1.0))
}

/// A reader of the rows of a table, and its header.
fn opened<'a>(path: &Path, text: &'a str) -> Result<(csv::Reader<&'a [u8]>, StringRecord)> {
    let builder = |text: &'a str, header: bool| {
        ReaderBuilder::new()
            .has_headers(header)
            .delimiter(delimiter(text))
            .comment(Some(b'#'))
            .trim(Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes())
    };
    let mut reader = builder(text, true);
    let headers = reader
        .headers()
        .map_err(|e| Error::input(path.display(), "a header line").found(e))?
        .clone();
    match commented_header(text, &headers) {
        Some(names) => Ok((builder(text, false), names)),
        None => Ok((reader, headers)),
    }
}

/// The names in the last comment before the rows, of a table whose first row is numbers and has as many (a node map of ARAMIS).
fn commented_header(text: &str, first: &StringRecord) -> Option<StringRecord> {
    if first.is_empty() || !first.iter().all(|c| c.is_empty() || number(c).is_some()) {
        return None;
    }
    let lines = text.lines().map(str::trim_start).filter(|l| !l.is_empty());
    let comment = lines.map_while(|l| l.strip_prefix('#')).last()?;
    let separator = char::from(delimiter(text));
    let names = comment.split(separator).map(|n| n.trim().trim_matches('"'));
    let names: StringRecord = names.collect();
    let named = names.iter().any(|n| !n.is_empty() && number(n).is_none());
    (named && names.len() == first.len()).then_some(names)
}

/// The delimiter that occurs most often in the first line that is no comment, outside quotes; a comma if none does.
fn delimiter(text: &str) -> u8 {
    let header = text
        .lines()
        .find(|line| !line.starts_with('#') && !line.trim().is_empty())
        .unwrap_or("");
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for byte in header.bytes() {
        quoted ^= byte == b'"';
        if let Some((_, count)) = counts
            .iter_mut()
            .find(|(delimiter, _)| !quoted && *delimiter == byte)
        {
            *count += 1;
        }
    }
    // the first of equals: a comma before a semicolon before a tab
    counts
        .iter()
        .rev()
        .max_by_key(|(_, count)| *count)
        .map_or(b',', |(delimiter, _)| *delimiter)
}

/// Line of the record whose reading began at `byte`: blank and comment lines before it were skipped unseen.
fn line_at(text: &str, byte: u64) -> usize {
    let mut start = usize::try_from(byte).unwrap_or(0).min(text.len());
    let bytes = text.as_bytes();
    while let Some(&first) = bytes.get(start) {
        match first {
            b'\n' | b'\r' => start += 1,
            b'#' => {
                start += bytes[start..]
                    .iter()
                    .position(|b| *b == b'\n')
                    .unwrap_or(bytes.len() - start)
            }
            _ => break,
        }
    }
    1 + bytes[..start].iter().filter(|b| **b == b'\n').count()
}
