//! A table in a text: found behind whatever a program writes before it, and read row by row to what it writes after it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::cells::{Delimiter, bare, column_name, comma_in, is_no_value, number};
use super::heading::{self, FoundHeader, begins};
use super::programs::{matching, unit_of};
use super::reader::Columns;
use super::text;
use crate::error::{Error, Result};

/// Lines of Tecplot between header and rows.
const TECPLOT: &[&str] = &[
    "zone",
    "title",
    "filetype",
    "variables",
    "i=",
    "j=",
    "k=",
    "dt=",
    "dt =",
    "datapacking",
    "strandid",
    "solutiontime",
    "auxdata",
    "datasetauxdata",
    "text ",
    "t=",
    "f=",
    "varlocation",
    "zonetype",
    "passivevarlist",
    "nodes",
    "elements",
];

/// Beginnings of lines without numbers.
const COMMENTS: &[&str] = &["#", "%", "***", "!", "//", "$"];

/// A table found in a file.
pub(super) struct Sheet {
    path: PathBuf,
    text: String,
    /// Names of the columns.
    pub names: Vec<String>,
    /// Line of the header, from 1.
    pub line: usize,
    /// Units in a row of their own below the header.
    pub units: Option<Vec<Option<&'static str>>>,
    /// Number of the first line after the header, and where it begins.
    rows: (usize, usize),
    delimiter: Delimiter,
    /// Whether the decimal sign is a comma.
    pub comma: bool,
    /// What was passed over or assumed, and should be known.
    pub remarks: Vec<String>,
}

impl Sheet {
    /// The table of the file at `path` whose header is `wanted`; else that of the first line before a row of as many numbers.
    ///
    /// # Errors
    /// Of the input: a file that cannot be read or holds no table, decimal signs that contradict each other.
    pub fn open(path: &Path, wanted: &dyn Fn(&[String]) -> bool) -> Result<Self> {
        let (text, encoding) = text::read(path)?;
        let FoundHeader {
            names,
            delimiter,
            line,
            after,
        } = heading::find(path, &text, wanted)?;
        let mut sheet = Self {
            path: path.to_owned(),
            names,
            line,
            units: None,
            rows: after,
            delimiter,
            comma: false,
            remarks: Vec::new(),
            text,
        };
        sheet
            .remarks
            .extend(encoding.map(|name| format!("read as {name}")));
        sheet.take_units();
        sheet.take_delimiter();
        sheet.take_decimal_sign()?;
        Ok(sheet)
    }

    /// The lines before the header.
    pub fn preamble(&self) -> impl Iterator<Item = &str> {
        self.text.lines().take(self.line - 1)
    }

    /// Names of the coordinate and the displacement out of the plane, if these columns are a program's that writes both.
    pub fn out_of_plane(&self, columns: &Columns) -> Option<[String; 2]> {
        let preamble = self.preamble().collect::<Vec<_>>().join("\n");
        let found = matching(&self.names, self.units.as_deref(), &preamble)?;
        let Columns { x, y, ux, uy, .. } = columns;
        let declared = [x, y, ux, uy].map(|name| name.trim_start_matches('-'));
        let [z, uz] = found.out_of_plane;
        (found.columns == declared).then_some([z?, uz?])
    }

    fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        let (number, at) = self.rows;
        let lines = self.text[at..].lines().enumerate();
        lines.map(move |(k, line)| (number + k, line))
    }

    /// Lines that may be rows, with their numbers.
    fn candidates(&self) -> impl Iterator<Item = (usize, &str)> {
        self.lines().filter(|(_, line)| {
            let line = line.trim_start_matches(['\u{feff}', ' ', '\t']);
            let is_comment = COMMENTS.iter().any(|sign| line.starts_with(sign));
            // #N/A is a value that is missing
            let first = line.split([';', ',', '\t', ' ']).next().unwrap_or_default();
            !line.is_empty() && (!is_comment || is_no_value(bare(first)))
        })
    }

    /// A row of units below the header is taken away.
    fn take_units(&mut self) {
        let mut cells = Vec::new();
        let Some((first, line)) = self.lines().find(|(_, line)| !line.trim().is_empty()) else {
            return;
        };
        self.delimiter.split(line, &mut cells);
        let known = |cell: &str| unit_of(cell.trim_matches(|c| "[]()".contains(c)));
        let units: Vec<_> = cells.iter().map(|cell| known(cell)).collect();
        let no_number = cells
            .iter()
            .all(|c| number(c, false).is_none_or(f64::is_nan));
        // words that are neither are units too: ones that are not known
        let is_words = !COMMENTS
            .iter()
            .any(|sign| line.trim_start().starts_with(sign))
            && !TECPLOT.iter().any(|word| begins(line, word))
            && !self.is_header(&cells)
            && cells
                .iter()
                .all(|c| number(c, false).is_none() && number(c, true).is_none());
        if units.len() < self.names.len()
            || !no_number
            || units.iter().all(Option::is_none) && !is_words
        {
            return;
        }
        let end = line.as_ptr() as usize - self.text.as_ptr() as usize + line.len();
        let newline = self.text[end..]
            .find('\n')
            .map_or(self.text.len(), |k| end + k + 1);
        self.rows = (first + 1, newline);
        self.units = Some(units);
    }

    /// Rows may be separated otherwise than the header (Tecplot, DaVis).
    fn take_delimiter(&mut self) {
        let mut cells = Vec::new();
        let is_tecplot = |line: &str| TECPLOT.iter().any(|w| begins(line, w));
        let first = self
            .candidates()
            .map(|(_, line)| line)
            .find(|line| !is_tecplot(line));
        let Some(first) = first else { return };
        let mut fits = |delimiter: &Delimiter| {
            delimiter.split(first, &mut cells);
            let end = cells.len() - usize::from(cells.last().is_some_and(|c| c.is_empty()));
            cells.len() == self.names.len() || end == self.names.len()
        };
        let own = std::iter::once(self.delimiter);
        if let Some(delimiter) = own.chain(Delimiter::ALL).find(&mut fits) {
            self.delimiter = delimiter;
        }
    }

    /// The decimal sign is what the numbers of the whole file have.
    fn take_decimal_sign(&mut self) -> Result<()> {
        if !self.text[self.rows.1..].contains(',')
            || (self.delimiter == Delimiter::Sign(',') && !self.text.contains(['"', '\u{201c}']))
        {
            return Ok(());
        }
        let (mut sure, mut doubtful, mut points) = (false, None, false);
        let mut cells = Vec::new();
        for (line, row) in self.candidates() {
            self.delimiter.split(row, &mut cells);
            for cell in &cells {
                match comma_in(cell) {
                    Some(true) => sure = true,
                    Some(false) => doubtful = doubtful.or(Some((line, cell.to_string()))),
                    None => {
                        points |=
                            cell.contains('.') && number(cell, false).is_some_and(f64::is_finite)
                    }
                }
            }
        }
        match (sure, points, doubtful) {
            (true, false, _) => {
                self.comma = true;
                self.remarks.push("decimal commas".into());
            }
            (false, false, Some((line, cell))) => {
                let place = format!("{}:{line}", self.path.display());
                return Err(Error::input(place, "a decimal point, or decimals that tell a decimal comma from a thousands separator")
                    .found(cell)
                    .hint("export with a decimal point and without thousands separators"));
            }
            // with points elsewhere a comma is an error, named where it is read
            _ => {}
        }
        Ok(())
    }

    /// Call `each` with the line and the cells of every row.
    ///
    /// # Errors
    /// Of the input: those of `each`, a row of another length, a line among the rows that is none, a last line that was cut.
    pub fn rows(&self, each: &mut dyn FnMut(usize, &[&str]) -> Result<()>) -> Result<Vec<String>> {
        let mut cells = Vec::new();
        let mut foreign: Option<(usize, &str)> = None;
        let mut first_is_number = None;
        let (mut areas, mut tails) = (0, Tails::new(&self.text));
        let numeric = |cell: &str| number(cell, self.comma).is_some();
        for (line, row) in self.candidates() {
            self.delimiter.split(row, &mut cells);
            if cells.len() == self.names.len() + 1 && cells.last().is_some_and(|c| c.is_empty()) {
                cells.pop();
            }
            if self.is_between(row, &cells)? {
                areas += usize::from(self.is_header(&cells));
                foreign = foreign.filter(|_| !self.is_header(&cells));
                continue;
            }
            let begins = cells.first().is_some_and(|c| numeric(c));
            let counted = cells.len() == self.names.len();
            let like_first = begins || first_is_number == Some(false);
            let numbers = cells.iter().filter(|c| numeric(c)).count();
            let may_be_first = counted && first_is_number.is_none() && 2 * numbers > cells.len();
            if !like_first && !may_be_first {
                foreign = foreign.or(Some((line, row)));
                continue;
            }
            match foreign.take() {
                Some((line, row)) if first_is_number.is_some() => {
                    return Err(self.no_row(line, row));
                }
                // between header and rows as before the header
                _ => {}
            }
            if !counted {
                return Err(self.of_another_length(line, cells.len()));
            }
            first_is_number = first_is_number.or(Some(begins));
            let last = cells.last().copied().unwrap_or_default();
            if tails.is_cut(last, line) {
                return Err(Error::input(
                    self.place(line),
                    "a last number with as many decimals as those above it",
                )
                .found(last)
                .hint("a file that was cut? export or copy it again, or delete this line"));
            }
            each(line, &cells)?;
        }
        let mut remarks = Vec::new();
        if areas > 0 {
            remarks.push(format!(
                "the header stands {} times: the areas are read as one field",
                areas + 1
            ));
        }
        if let Some((line, row)) = foreign {
            let row: String = row.trim().chars().take(40).collect();
            remarks.push(format!(
                "what follows the points from line {line} on is passed over: {row}"
            ));
        }
        Ok(remarks)
    }

    /// A line between rows that is no row: the header again, the units again, words of Tecplot.
    fn is_between(&self, row: &str, cells: &[&str]) -> Result<bool> {
        let lower = row
            .contains('=')
            .then(|| row.to_lowercase().replace(' ', ""));
        let lower = lower.unwrap_or_default();
        if lower.contains("f=block") || lower.contains("datapacking=block") {
            return Err(Error::input(self.path.display(), "one point a line")
                .found(row.trim())
                .hint("export with DATAPACKING=POINT"));
        }
        let tecplot = TECPLOT.iter().any(|word| begins(row, word));
        let units = cells.len() == self.names.len()
            && cells
                .iter()
                .all(|c| number(c, self.comma).is_none_or(f64::is_nan))
            && cells
                .iter()
                .any(|c| unit_of(c.trim_matches(|c| "[]()".contains(c))).is_some());
        Ok(tecplot || units || self.is_header(cells))
    }

    fn is_header(&self, cells: &[&str]) -> bool {
        let named = self.names.iter().map(String::as_str);
        cells.len() >= self.names.len()
            && named.eq(cells.iter().take(self.names.len()).map(|c| column_name(c)))
    }

    fn place(&self, line: usize) -> String {
        format!("{}:{line}", self.path.display())
    }

    fn no_row(&self, line: usize, row: &str) -> Error {
        let expected = format!("a row of {} cells, as the lines about it", self.names.len());
        Error::input(self.place(line), expected)
            .found(row.trim())
            .hint("delete this line, or give each table a file of its own")
    }

    fn of_another_length(&self, line: usize, count: usize) -> Error {
        let expected = format!("{} cells as in the header", self.names.len());
        let error = Error::input(self.place(line), expected).found(format!("{count} cells"));
        if self.delimiter == Delimiter::Sign(',') && count > self.names.len() {
            error.hint("commas as decimal sign and between cells? export with a decimal point, or with semicolons between cells")
        } else {
            error.hint("a line that was cut? export the file again")
        }
    }
}

/// Numbers of decimals in the last cells of rows, and whether an exponent follows them.
struct Tails {
    /// The last line, where the file does not end it.
    open_line: Option<usize>,
    /// How many rows have which number.
    counts: BTreeMap<(usize, bool), usize>,
}

impl Tails {
    fn new(text: &str) -> Self {
        Self {
            open_line: (!text.ends_with(['\n', '\r'])).then(|| text.lines().count()),
            counts: BTreeMap::new(),
        }
    }

    /// Whether a row's last cell was cut: it ends the file, and has fewer decimals than nearly all before, or no exponent.
    fn is_cut(&mut self, cell: &str, line: usize) -> bool {
        /// Rows that may differ.
        const FEW: usize = 20;
        if is_no_value(cell) || self.open_line.is_none() {
            return false;
        }
        let (mantissa, has_exponent) = match cell.find(['e', 'E', 'd', 'D']) {
            Some(k) => (&cell[..k], true),
            None => (cell, false),
        };
        let decimals = mantissa
            .rsplit_once(['.', ','])
            .map_or(0, |(_, tail)| tail.len());
        let tail = (decimals, has_exponent);
        let all: usize = self.counts.values().sum();
        let usual = self.counts.iter().max_by_key(|(_, n)| **n);
        let shorter = usual.is_some_and(|((length, exponent), n)| {
            let lacks = *length > decimals || *exponent && !has_exponent;
            lacks && n * FEW >= all * (FEW - 1)
        });
        *self.counts.entry(tail).or_default() += 1;
        shorter && self.open_line == Some(line)
    }
}
