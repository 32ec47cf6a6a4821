//! Chain CSV: our own `chain.csv` (`chain,draw,lp__,NAME...`), and any program's CSV of draws (Stan CSV with `#`
//! comments, one file a chain). Floats are written so that they read back to the same bits.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};

use super::columns::{ColumnRole, is_draw, role};
use super::draws::{Chains, Draws};
use super::header::{ChainHeader, number};
use super::stan::StanSettings;
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
enum Failed {
    Reading(Error),
    Writing(std::io::Error),
}

/// Write a file of chains that are read on the way. Half of it never stays.
fn write_chains(
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
    let header = |number: usize, out: &mut dyn Write| header(chains.names(), number, out);
    files::all_or_none(|written| {
        write_ensembles((chains, stem, "csv"), header, write_chain, written)
    })
}

/// Writes a file `STEM_1.ENDING`, `STEM_2.ENDING`, ... of each ensemble, its walkers one after the other.
pub(super) fn write_ensembles(
    (chains, stem, ending): (&dyn Chains, &Path, &str),
    header: impl Fn(usize, &mut dyn Write) -> std::io::Result<()>,
    write_chain: impl Fn(&Draws, &mut dyn Write) -> std::io::Result<()>,
    written: &mut Vec<PathBuf>,
) -> Result<()> {
    for (number, members) in chains.groups().into_iter().enumerate() {
        let mut path = stem.as_os_str().to_owned();
        path.push(format!("_{}.{ending}", number + 1));
        write_chains(Path::new(&path), |out| {
            header(number, out).map_err(Failed::Writing)?;
            for chain in members {
                let draws = chains.chain(chain).map_err(Failed::Reading)?;
                write_chain(&draws, out).map_err(Failed::Writing)?;
            }
            Ok(())
        })?;
        written.push(path.into());
    }
    Ok(())
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
/// file is a chain (Stan CSV). `#` comments are skipped, but for one with the names of the columns before the first row
/// (numpy.savetxt); `lp__` is the log density (NaN if there is none); other columns of the sampler go to `info.columns`.
/// Every chain counts as its own ensemble: see [`Draws::with_walkers`].
///
/// # Errors
/// The input's fault, naming file, line and column: an unreadable file, a missing header, a row of the wrong
/// length, a value that is no number, chains of different length, files of different columns or models.
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
    /// The model that the file names.
    model: Option<String>,
    remarks: Vec<String>,
}

impl CsvTable {
    fn join(&mut self, other: Self, path: &Path) -> Result<()> {
        if let (Some(model), Some(another)) = (&self.model, &other.model)
            && model != another
        {
            let expected = format!("chains of one model, {model}, as in the first file");
            return Err(Error::input(path.display(), expected)
                .found(format!("model = {another}"))
                .hint(
                    "chains of different models have no posterior in common: diagnose them apart",
                ));
        }
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
            match (name.as_str(), role(name, &self.columns)) {
                (_, Some(ColumnRole::LogDensity)) => lp = column(at),
                (_, Some(role)) => {
                    apart.push((role.name().unwrap_or(name).to_string(), column(at)));
                }
                _ if is_draw(at, name) => {}
                ("weight" | "weights", _) if column(at).windows(2).any(|w| w[0] != w[1]) => {
                    return Err(Error::input(&place, "draws of equal weight")
                        .found(format!("a column {name} of unequal numbers"))
                        .hint("give the files with weights that GetDist or Cobaya writes, or resample; if it is a parameter, rename it"));
                }
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
        draws.info.columns = apart;
        Ok(draws)
    }
}

/// Bytes of a line that ends somewhere: a million columns of 25 characters have fewer.
const LONGEST_LINE: u64 = 1 << 26;

/// The text of a chain file, line by line.
fn opened(path: &Path) -> Result<Box<dyn BufRead>> {
    let unreadable = |e| Error::input(path.display(), "a readable chain file").found(e);
    let mut text = BufReader::new(File::open(path).map_err(unreadable)?);
    let start = text.fill_buf().map_err(unreadable)?;
    if let Some((what, hint)) = files::in_place_of(start) {
        let error = Error::input(path.display(), "chains as text, .npz or a Zarr store");
        return Err(error.found(what).hint(hint));
    }
    // UTF-16, as a shell of Windows redirects
    if start.starts_with(&[0xff, 0xfe]) || start.starts_with(&[0xfe, 0xff]) {
        let mut bytes = Vec::new();
        text.read_to_end(&mut bytes).map_err(unreadable)?;
        return Ok(Box::new(Cursor::new(files::plain(bytes))));
    }
    Ok(Box::new(text))
}

/// Read the next line into `line`; whether there was one.
fn next_line(
    text: &mut dyn BufRead,
    line: &mut String,
    place: &dyn Fn() -> String,
) -> Result<bool> {
    line.clear();
    let read = text.take(LONGEST_LINE).read_line(line);
    let length = read.map_err(|e| Error::input(place(), "UTF-8 text").found(e))?;
    if length as u64 == LONGEST_LINE {
        let expected = format!("lines of fewer than {LONGEST_LINE} bytes");
        return Err(Error::input(place(), expected)
            .found("no end of the line")
            .hint("this is no file of draws"));
    }
    Ok(length > 0)
}

fn read_table(path: &Path) -> Result<CsvTable> {
    let mut text = opened(path)?;
    let mut header: Option<ChainHeader> = None;
    let mut chains: Vec<(String, Vec<f64>)> = Vec::new();
    let mut settings = StanSettings::default();
    let (mut line, mut comment) = (String::new(), String::new());
    for index in 0.. {
        let place = || format!("{}, line {}", path.display(), index + 1);
        if !next_line(&mut *text, &mut line, &place)? {
            break;
        }
        let line = line.trim_start_matches('\u{feff}').trim();
        if let Some(text) = line.strip_prefix(['#', '%']) {
            settings.read(text).map_err(|e| e.within(place()))?;
            if header.is_none() {
                text.trim().clone_into(&mut comment);
            }
            continue;
        }
        if line.is_empty() {
            continue;
        }
        let header = match &mut header {
            Some(header) => header,
            None => {
                let (found, is_row) =
                    ChainHeader::before(line, &comment).map_err(|e| e.within(place()))?;
                let found = header.insert(found);
                if !is_row {
                    continue;
                }
                found
            }
        };
        let fields = header.row(line).map_err(|e| e.within(place()))?;
        let label = header.chain.map_or("", |at| fields[at]);
        let rows = rows_of(&mut chains, label);
        for (at, field) in fields.iter().enumerate() {
            if !header.is_read(at) {
                continue;
            }
            let value = number(field).ok_or_else(|| {
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
    mut columns: Vec<String>,
    mut chains: Vec<(String, Vec<f64>)>,
    settings: &StanSettings,
) -> Result<CsvTable> {
    let draw = (0..columns.len()).find(|&at| is_draw(at, &columns[at]));
    let depth = columns
        .iter()
        .position(|c| role(c, &columns) == Some(ColumnRole::TreeDepth));
    let limit = settings.max_depth.unwrap_or(f64::INFINITY);
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
        if let Some(at) = depth {
            let saturated = |row: &[f64]| [row, &[f64::from(row[at] >= limit)]].concat();
            *rows = rows.chunks(columns.len()).flat_map(saturated).collect();
        }
    }
    if depth.is_some() {
        columns.push("saturated__".into());
    }
    let remarks = settings.remark(path).into_iter().collect();
    Ok(CsvTable {
        columns,
        chains,
        model: settings.model.clone(),
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
