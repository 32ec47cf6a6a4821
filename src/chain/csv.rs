//! Chain CSV: our own `chain.csv` (`chain,draw,lp__,NAME...`), and any program's CSV of draws (Stan CSV with `#`
//! comments, one file a chain). Floats are written so that they read back to the same bits.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use super::draws::{Chains, Draws};
use crate::error::{Error, Result};
use crate::files;

/// Writes `chain.csv`: columns `chain,draw,lp__` and the parameters, chain by chain, counted from 0.
///
/// # Errors
/// The input's fault (with the path) if the file cannot be written.
pub fn write_csv(chains: &dyn Chains, path: &Path) -> Result<()> {
    write_chains(path, |out| {
        writeln!(out, "chain,draw,lp__,{}", chains.names().join(",")).map_err(Failed::Writing)?;
        for chain in 0..chains.count() {
            let draws = chains.chain(chain).map_err(Failed::Reading)?;
            write_rows(&draws, chain, out).map_err(Failed::Writing)?;
        }
        Ok(())
    })
}

/// Why chains were not written.
pub(super) enum Failed {
    Reading(Error),
    Writing(std::io::Error),
}

/// Write a file of chains that are read on the way. Half of it never stays.
pub(super) fn write_chains(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::result::Result<(), Failed>,
) -> Result<()> {
    let mut damaged = None;
    let written = files::replace_with(path, |out| match write(out) {
        Ok(()) => Ok(()),
        Err(Failed::Writing(e)) => Err(e),
        Err(Failed::Reading(e)) => {
            damaged = Some(e);
            Err(std::io::ErrorKind::InvalidData.into())
        }
    });
    damaged.map_or(written, Err)
}

/// Writes Stan CSV: one file an ensemble, its walkers one after the other, `STEM_1.csv`, `STEM_2.csv`, ..., with `lp__` and the parameters.
///
/// # Errors
/// The input's fault (with the path) if a file cannot be written.
pub fn write_stan(chains: &dyn Chains, stem: &Path) -> Result<()> {
    files::together(|written| {
        for (number, members) in chains.groups().into_iter().enumerate() {
            let mut path = stem.as_os_str().to_owned();
            path.push(format!("_{}.csv", number + 1));
            write_chains(Path::new(&path), |out| {
                header(chains.names(), number, out).map_err(Failed::Writing)?;
                for chain in members {
                    let draws = chains.chain(chain).map_err(Failed::Reading)?;
                    write_chain(&draws, out).map_err(Failed::Writing)?;
                }
                Ok(())
            })?;
            written.push(path.into());
        }
        Ok(())
    })
}

fn header(names: &[String], number: usize, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "# model = plychain")?;
    writeln!(out, "# id = {}", number + 1)?;
    // Stan's names have no dots of their own: a dot counts elements there.
    let names: Vec<String> = names.iter().map(|n| n.replace('.', "_")).collect();
    writeln!(out, "lp__,{}", names.join(","))
}

fn write_chain(draws: &Draws, out: &mut dyn Write) -> std::io::Result<()> {
    for draw in 0..draws.draws() {
        write!(out, "{:?}", draws.lp()[draw])?;
        for value in draws.point(0, draw) {
            write!(out, ",{value:?}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn write_rows(draws: &Draws, number: usize, out: &mut dyn Write) -> std::io::Result<()> {
    for (draw, (point, lp)) in draws.points().zip(draws.lp()).enumerate() {
        // `{:?}` prints the shortest decimal that reads back to the same double.
        write!(out, "{number},{draw},{lp:?}")?;
        for value in point {
            write!(out, ",{value:?}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Reads the draws of one run from CSV files. A file with a `chain` column may hold many chains; without one each
/// file is a chain (Stan CSV). `#` comments are skipped; `lp__` is the log density (NaN if there is none); other
/// columns ending in `__` are the sampler's and go to `info.columns`. Every chain counts as its own ensemble:
/// see [`Draws::with_walkers`].
///
/// # Errors
/// The input's fault, naming file, line and column: an unreadable file, a missing header, a row of the wrong
/// length, a value that is no number, chains of different length, files of different columns.
pub fn read_csv(paths: &[&Path]) -> Result<Draws> {
    let mut table: Option<CsvTable> = None;
    for &path in paths {
        let one = read_table(path)?;
        match &mut table {
            None => table = Some(one),
            Some(all) => all.join(one, path)?,
        }
    }
    table
        .ok_or_else(|| Error::input("chain files", "at least one"))?
        .into_draws(paths)
}

/// The columns of a file and the rows of each chain.
struct CsvTable {
    columns: Vec<String>,
    /// What each chain is called, with its rows, row-major over `columns`.
    chains: Vec<(String, Vec<f64>)>,
    remarks: Vec<String>,
}

impl CsvTable {
    fn join(&mut self, other: Self, path: &Path) -> Result<()> {
        if self.columns != other.columns {
            return Err(
                Error::input(path.display(), "the same columns as the first file")
                    .found(other.columns.join(",")),
            );
        }
        self.chains.extend(other.chains);
        self.remarks.extend(other.remarks);
        Ok(())
    }

    fn into_draws(self, paths: &[&Path]) -> Result<Draws> {
        let width = self.columns.len();
        let place = paths
            .first()
            .map_or(String::new(), |p| p.display().to_string());
        let (label, rows) = self
            .chains
            .first()
            .ok_or_else(|| Error::input(&place, "at least one draw"))?;
        for (other, theirs) in &self.chains {
            let [own, first] = [theirs.len() / width, rows.len() / width];
            if own != first {
                let (short, long) = match own < first {
                    true => ([other, &own.to_string()], [label, &first.to_string()]),
                    false => ([label, &first.to_string()], [other, &own.to_string()]),
                };
                let expected = format!("as many draws as in {}, {}", long[0], long[1]);
                return Err(Error::input(short[0], expected)
                    .found(short[1])
                    .hint("a chain that was stopped has fewer: leave it out, or cut the others"));
            }
        }
        let column = |at: usize| -> Vec<f64> {
            let rows = self.chains.iter().flat_map(|(_, rows)| rows.chunks(width));
            rows.map(|row| row[at]).collect()
        };
        let count = self.chains.len() * rows.len() / width;
        let mut lp = vec![f64::NAN; count];
        let (mut names, mut kept, mut apart) = (Vec::new(), Vec::new(), Vec::new());
        for (at, name) in self.columns.iter().enumerate() {
            match name.as_str() {
                "lp__" => lp = column(at),
                _ if is_draw(at, name) => {}
                "weight" | "weights" if column(at).windows(2).any(|w| w[0] != w[1]) => {
                    return Err(Error::input(&place, "draws of equal weight")
                        .found(format!("a column {name} of unequal numbers"))
                        .hint("give the files with weights that GetDist or Cobaya writes, or resample; if it is a parameter, rename it"));
                }
                _ if name.ends_with("__") => apart.push((name.clone(), column(at))),
                _ => {
                    names.push(name.clone());
                    kept.push(at);
                }
            }
        }
        let rows = self.chains.iter().flat_map(|(_, rows)| rows.chunks(width));
        let values = rows
            .flat_map(|row| kept.iter().map(|&at| row[at]))
            .collect();
        let mut draws = Draws::new(names, (0..self.chains.len()).collect(), values, lp)?;
        draws.refuse_copies(&|k| self.chains[k].0.clone())?;
        draws.info.remarks = self.remarks;
        draws.info.remarks.extend(diverged(&apart));
        draws.info.columns = apart;
        Ok(draws)
    }
}

/// Bytes of a line that ends somewhere: a million columns of 25 characters have fewer.
const LONGEST_LINE: u64 = 1 << 26;

/// What programs call the number of a chain (ours and ArviZ; posterior of R; coda of R), and that of a draw.
const CHAIN: &[&str] = &["chain", ".chain", "CHAIN", "Chain", "chain_id"];
const DRAW: &[&str] = &[
    "draw",
    ".draw",
    "iteration",
    ".iteration",
    "ITER",
    "Iteration",
];

/// The same where it is the first column alone (BEAST and others): further on it is a parameter.
const COUNTER: &[&str] = &["state", "Sample", "iter", "Iter", "Gen"];

/// Whether the column number `at` counts draws.
fn is_draw(at: usize, name: &str) -> bool {
    DRAW.contains(&name) || at == 0 && COUNTER.contains(&name)
}

/// What Stan's column of divergent transitions says.
fn diverged(columns: &[(String, Vec<f64>)]) -> Option<String> {
    let (_, column) = columns.iter().find(|(name, _)| name == "divergent__")?;
    let count = column.iter().filter(|d| **d != 0.0).count();
    let of = column.len();
    (count > 0).then(|| format!("{count} of {of} draws ended in a divergent transition: the chains may miss a part of the posterior, whatever the figures say"))
}

/// The cells of a line, without blanks and quotation marks; no sign is any number of blanks.
fn cells(line: &str, sign: Option<char>) -> Vec<&str> {
    let ends = |c: char| sign.map_or(c.is_whitespace(), |sign| c == sign);
    let cells = files::cells(line, ends).map(|f| f.trim().trim_matches('"'));
    cells.filter(|f| sign.is_some() || !f.is_empty()).collect()
}

/// The header of a file: its columns, and what stands between the cells.
struct ChainHeader {
    columns: Vec<String>,
    sign: Option<char>,
    chain: Option<usize>,
    /// Whether no row was read yet.
    is_first: bool,
}

impl ChainHeader {
    fn new(line: &str) -> Result<Self> {
        let splits = |s: &char| cells(line, Some(*s)).len() > 1;
        let sign = [',', ';', '\t'].into_iter().find(splits);
        let columns: Vec<String> = cells(line, sign).into_iter().map(String::from).collect();
        check_header(&columns)?;
        Ok(Self {
            chain: columns.iter().position(|c| CHAIN.contains(&c.as_str())),
            columns,
            sign,
            is_first: true,
        })
    }

    /// The cells of a row. Names of rows, as R writes them, have no name of their own.
    fn row<'a>(&mut self, line: &'a str) -> Result<Vec<&'a str>> {
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
    fn is_read(&self, at: usize) -> bool {
        Some(at) != self.chain && !(at == 0 && self.columns[0].is_empty())
    }
}

fn read_table(path: &Path) -> Result<CsvTable> {
    let unreadable = |e| Error::input(path.display(), "a readable chain file").found(e);
    let mut text = BufReader::new(File::open(path).map_err(unreadable)?);
    let start = text.fill_buf().map_err(unreadable)?;
    if let Some((what, hint)) = files::in_place_of(start) {
        let error = Error::input(path.display(), "chains as text, .npz or a Zarr store");
        return Err(error.found(what).hint(hint));
    }
    let mut header: Option<ChainHeader> = None;
    let mut chains: Vec<(String, Vec<f64>)> = Vec::new();
    let mut settings = StanSettings::default();
    let mut line = String::new();
    for index in 0.. {
        let place = || format!("{}, line {}", path.display(), index + 1);
        line.clear();
        let read = (&mut text).take(LONGEST_LINE).read_line(&mut line);
        match read.map_err(|e| Error::input(place(), "UTF-8 text").found(e))? {
            0 => break,
            length if length as u64 == LONGEST_LINE => {
                let expected = format!("lines of fewer than {LONGEST_LINE} bytes");
                return Err(Error::input(place(), expected)
                    .found("no end of the line")
                    .hint("this is no file of draws"));
            }
            _ => {}
        }
        let line = line.trim_start_matches('\u{feff}').trim();
        if let Some(comment) = line.strip_prefix('#') {
            settings.read(comment).map_err(|e| e.within(place()))?;
            continue;
        }
        if line.is_empty() {
            continue;
        }
        let Some(header) = &mut header else {
            header = Some(ChainHeader::new(line).map_err(|e| e.within(place()))?);
            continue;
        };
        let fields = header.row(line).map_err(|e| e.within(place()))?;
        let label = header.chain.map_or("", |at| fields[at]);
        let rows = rows_of(&mut chains, label);
        for (at, field) in fields.iter().enumerate() {
            if !header.is_read(at) {
                continue;
            }
            let value = field.parse::<f64>().map_err(|_| {
                let place = format!("{}, column {}", place(), header.columns[at]);
                let error = Error::input(place, "a number, with a decimal point");
                error.found(field)
            })?;
            rows.push(value);
        }
    }
    let header = header.ok_or_else(|| {
        let expected = "a header line with the names of the columns";
        Error::input(path.display(), expected)
    })?;
    let kept = (0..header.columns.len()).filter(|at| header.is_read(*at));
    let columns = kept.map(|at| header.columns[at].clone()).collect();
    finished(path, columns, chains, &settings)
}

/// The table of chains that were read: draws in order, without those of the warm-up.
fn finished(
    path: &Path,
    columns: Vec<String>,
    mut chains: Vec<(String, Vec<f64>)>,
    settings: &StanSettings,
) -> Result<CsvTable> {
    let draw = (0..columns.len()).find(|&at| is_draw(at, &columns[at]));
    for (label, rows) in &mut chains {
        *label = match label.is_empty() {
            true => path.display().to_string(),
            false => format!("chain {label} of {}", path.display()),
        };
        if let Some(at) = draw {
            *rows =
                in_order(std::mem::take(rows), columns.len(), at).map_err(|e| e.within(&*label))?;
        }
        settings.leave_out_warmup(rows, columns.len());
    }
    let remarks = settings.remark(path).into_iter().collect();
    Ok(CsvTable {
        columns,
        chains,
        remarks,
    })
}

/// Rows by the number of their draw, which stands in a column.
fn in_order(rows: Vec<f64>, width: usize, at: usize) -> Result<Vec<f64>> {
    let mut ordered: Vec<&[f64]> = rows.chunks(width).collect();
    if ordered.is_sorted_by(|a, b| a[at] < b[at]) {
        return Ok(rows);
    }
    ordered.sort_by(|a, b| a[at].total_cmp(&b[at]));
    if let Some(twice) = ordered.windows(2).find(|w| w[0][at] == w[1][at]) {
        return Err(Error::input("column draw", "each number once")
            .found(format!("draw {} twice", twice[0][at]))
            .hint("were two runs written into one file?"));
    }
    Ok(ordered.concat())
}

/// What CmdStan's comments say of the draws below them.
#[derive(Default)]
struct StanSettings {
    warmup: usize,
    thin: usize,
    saved: bool,
}

impl StanSettings {
    fn read(&mut self, comment: &str) -> Result<()> {
        /// Methods of CmdStan whose rows are no draws of a Markov chain.
        const OTHER: [&str; 4] = ["optimize", "variational", "pathfinder", "laplace"];
        let Some((key, value)) = comment.split_once('=') else {
            return Ok(());
        };
        let value = value.split_whitespace().next().unwrap_or_default();
        let number = value.parse().unwrap_or(0);
        match key.trim() {
            // of RStan the second
            "num_warmup" | "warmup" => self.warmup = number,
            "thin" => self.thin = number,
            "save_warmup" => self.saved = ["1", "true"].contains(&value),
            "method" if OTHER.contains(&value) => {
                return Err(
                    Error::input("method", "draws of a Markov chain (method = sample)")
                        .found(value)
                        .hint("this file has no chain, so that nothing converges"),
                );
            }
            _ => {}
        }
        Ok(())
    }

    /// Draws of the warm-up that a chain begins with.
    fn stored(&self) -> usize {
        match self.saved {
            true => self.warmup.div_ceil(self.thin.max(1)),
            false => 0,
        }
    }

    fn leave_out_warmup(&self, rows: &mut Vec<f64>, width: usize) {
        let end = (self.stored() * width).min(rows.len());
        rows.drain(..end);
    }

    fn remark(&self, path: &Path) -> Option<String> {
        let stored = self.stored();
        let path = path.display();
        (stored > 0).then(|| format!("{path}: the first {stored} draws are left out (save_warmup)"))
    }
}

/// The rows of the chain called `label`; the search from the end makes sorted files cheap.
fn rows_of<'a>(chains: &'a mut Vec<(String, Vec<f64>)>, label: &str) -> &'a mut Vec<f64> {
    let at = match chains.iter().rposition(|(known, _)| known == label) {
        Some(at) => at,
        None => {
            chains.push((label.to_string(), Vec::new()));
            chains.len() - 1
        }
    };
    &mut chains[at].1
}

fn check_header(fields: &[String]) -> Result<()> {
    let mut known = HashSet::new();
    for (at, field) in fields.iter().enumerate() {
        if (field.is_empty() && at > 0) || field.parse::<f64>().is_ok() {
            return Err(Error::input(
                format!("column {}", at + 1),
                "the name of a column (the first line that is no comment is the header)",
            )
            .found(field));
        }
        if !known.insert(field) {
            return Err(Error::input(format!("column {}", at + 1), "each name once").found(field));
        }
    }
    let is_parameter = |(at, f): (usize, &String)| {
        let counts = CHAIN.contains(&f.as_str()) || is_draw(at, f);
        !f.ends_with("__") && !f.is_empty() && !counts
    };
    if !fields.iter().enumerate().any(is_parameter) {
        return Err(Error::input("header", "at least one parameter").found(fields.join(",")));
    }
    Ok(())
}
