//! Chain CSV: our own `chain.csv` (`chain,draw,lp__,NAME...`), and any program's CSV of draws (Stan CSV with `#`
//! comments, one file a chain). Floats are written so that they read back to the same bits.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;

use super::draws::{Chains, Draws};
use crate::error::{Error, Result};

/// Writes `chain.csv`: columns `chain,draw,lp__` and the parameters, chain by chain, counted from 0.
///
/// # Errors
/// The input's fault (with the path) if the file cannot be written.
pub fn write_csv(chains: &dyn Chains, path: &Path) -> Result<()> {
    let failed = |e: std::io::Error| Error::input(path.display(), "a writable file").found(e);
    let mut out = BufWriter::new(File::create(path).map_err(failed)?);
    writeln!(out, "chain,draw,lp__,{}", chains.names().join(",")).map_err(failed)?;
    for chain in 0..chains.count() {
        write_rows(&chains.chain(chain)?, chain, &mut out).map_err(failed)?;
    }
    out.flush().map_err(failed)
}

/// Writes Stan CSV: one file an ensemble, its walkers one after the other, `STEM_1.csv`, `STEM_2.csv`, ..., with `lp__` and the parameters.
///
/// # Errors
/// The input's fault (with the path) if a file cannot be written.
pub fn write_stan(chains: &dyn Chains, stem: &Path) -> Result<()> {
    for (number, members) in chains.groups().into_iter().enumerate() {
        let mut path = stem.as_os_str().to_owned();
        path.push(format!("_{}.csv", number + 1));
        let path = Path::new(&path);
        let failed = |e: std::io::Error| Error::input(path.display(), "a writable file").found(e);
        let mut out = BufWriter::new(File::create(path).map_err(failed)?);
        header(chains.names(), number, &mut out).map_err(failed)?;
        for chain in members {
            write_chain(&chains.chain(chain)?, &mut out).map_err(failed)?;
        }
        out.flush().map_err(failed)?;
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
    /// Chain label as written (empty if the file has no such column) and its rows, row-major over `columns`.
    chains: Vec<(String, Vec<f64>)>,
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
            if theirs.len() != rows.len() {
                return Err(Error::input(
                    &place,
                    format!(
                        "as many draws in chain {other:?} as in {label:?}, {}",
                        rows.len() / width
                    ),
                )
                .found(theirs.len() / width));
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
                "draw" => {}
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
        draws.info.columns = apart;
        Ok(draws)
    }
}

fn read_table(path: &Path) -> Result<CsvTable> {
    let file = File::open(path)
        .map_err(|e| Error::input(path.display(), "a readable chain file").found(e))?;
    let mut header: Option<Vec<String>> = None;
    let mut chain_at = None;
    let mut chains: Vec<(String, Vec<f64>)> = Vec::new();
    for (index, line) in BufReader::new(file).lines().enumerate() {
        let place = || format!("{}, line {}", path.display(), index + 1);
        let line = line.map_err(|e| Error::input(place(), "UTF-8 text").found(e))?;
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line
            .split(',')
            .map(|f| f.trim().trim_matches('"'))
            .collect();
        let Some(columns) = &header else {
            check_header(&fields).map_err(|e| e.within(place()))?;
            chain_at = fields.iter().position(|&f| f == "chain");
            header = Some(fields.iter().map(ToString::to_string).collect());
            continue;
        };
        if fields.len() != columns.len() {
            return Err(Error::input(place(), format!("{} columns", columns.len()))
                .found(format!("{} columns", fields.len()))
                .hint("the last line of a chain that was killed may be cut: remove it"));
        }
        let label = chain_at.map_or("", |at| fields[at]);
        let rows = rows_of(&mut chains, label);
        for (at, (field, name)) in fields.iter().zip(columns).enumerate() {
            if Some(at) != chain_at {
                let value = field.parse::<f64>().map_err(|_| {
                    Error::input(format!("{}, column {name}", place()), "a number").found(field)
                })?;
                rows.push(value);
            }
        }
    }
    let mut columns = header.ok_or_else(|| {
        Error::input(
            path.display(),
            "a header line with the names of the columns",
        )
    })?;
    if let Some(at) = chain_at {
        columns.remove(at);
    }
    Ok(CsvTable { columns, chains })
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

fn check_header(fields: &[&str]) -> Result<()> {
    for (at, field) in fields.iter().enumerate() {
        if field.is_empty() || field.parse::<f64>().is_ok() {
            return Err(Error::input(
                format!("column {}", at + 1),
                "the name of a column (the first line that is no comment is the header)",
            )
            .found(field));
        }
        if fields[..at].contains(field) {
            return Err(Error::input(format!("column {}", at + 1), "each name once").found(field));
        }
    }
    let parameters = fields
        .iter()
        .filter(|f| !f.ends_with("__") && !["chain", "draw"].contains(f));
    if parameters.count() == 0 {
        return Err(Error::input("header", "at least one parameter").found(fields.join(",")));
    }
    Ok(())
}
