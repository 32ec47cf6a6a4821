//! GetDist files: `ROOT_N.txt` (weight, -log posterior, parameters), `ROOT.paramnames`, `ROOT.ranges`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::draws::{Chains, Draws};
use crate::error::{Error, Result};

fn beside(root: &Path, ending: &str) -> PathBuf {
    let mut path = root.as_os_str().to_owned();
    path.push(ending);
    PathBuf::from(path)
}

fn write(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(|e| Error::input(path.display(), "a writable file").found(e))
}

/// Writes the files, one an ensemble: its walkers, one after the other.
///
/// # Errors
/// The input's fault (with the path) if a file cannot be written.
pub fn write_getdist(chains: &dyn Chains, root: &Path) -> Result<()> {
    let (mut names, mut ranges) = (String::new(), String::new());
    for name in chains.names() {
        // Writing to a string cannot fail.
        let _ = writeln!(names, "{name}\t{}", name.replace('_', "\\_"));
        let positive = name.ends_with("_GPa") || name.ends_with("_nm");
        let low = if positive { "0" } else { "N" };
        let _ = writeln!(ranges, "{name} {low} N");
    }
    write(&beside(root, ".paramnames"), &names)?;
    write(&beside(root, ".ranges"), &ranges)?;
    for (k, members) in chains.groups().into_iter().enumerate() {
        let mut text = String::new();
        for chain in members {
            write_chain(&chains.chain(chain)?, &mut text);
        }
        write(&beside(root, &format!("_{}.txt", k + 1)), &text)?;
    }
    Ok(())
}

fn write_chain(draws: &Draws, text: &mut String) {
    for (point, lp) in draws.points().zip(draws.lp()) {
        let _ = write!(text, "1 {:?}", -lp);
        for value in point {
            let _ = write!(text, " {value:?}");
        }
        text.push('\n');
    }
}

/// Reads `ROOT_1.txt`, `ROOT_2.txt`, ... with `ROOT.paramnames`. Weights are repetitions, as Metropolis writes them.
///
/// # Errors
/// The input's fault, naming file and line: missing files, a weight that is no whole number, chains of different length.
pub fn read_getdist(root: &Path) -> Result<Draws> {
    let path = beside(root, ".paramnames");
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Error::input(path.display(), "the names of a GetDist chain").found(e))?;
    // A star marks a derived parameter.
    let names: Vec<String> = text
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .map(|name| name.trim_end_matches('*').to_string())
        .collect();
    let (mut values, mut lp, mut length) = (Vec::new(), Vec::new(), None);
    let mut chains = 0;
    while let Ok(text) = std::fs::read_to_string(beside(root, &format!("_{}.txt", chains + 1))) {
        chains += 1;
        let place = format!("{}_{chains}.txt", root.display());
        let before = lp.len();
        for (index, line) in text.lines().enumerate() {
            read_line(line, &names, &mut values, &mut lp)
                .map_err(|e| e.within(format!("{place}, line {}", index + 1)))?;
        }
        let count = lp.len() - before;
        if *length.get_or_insert(count) != count {
            return Err(Error::input(place, "as many draws as in the first chain").found(count));
        }
    }
    if chains == 0 {
        return Err(Error::input(
            format!("{}_1.txt", root.display()),
            "a GetDist chain",
        ));
    }
    Draws::new(names, (0..chains).collect(), values, lp)
}

fn read_line(line: &str, names: &[String], values: &mut Vec<f64>, lp: &mut Vec<f64>) -> Result<()> {
    let row: std::result::Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
    let row = row.map_err(|e| Error::input("row", "numbers").found(e))?;
    if row.is_empty() {
        return Ok(());
    }
    if row.len() != names.len() + 2 {
        return Err(Error::input("row", format!("{} numbers", names.len() + 2)).found(row.len()));
    }
    let weight = row[0];
    if weight.fract() != 0.0 || !(0.0..1e9).contains(&weight) {
        return Err(Error::input("weight", "a whole number of repetitions").found(weight));
    }
    for _ in 0..weight as usize {
        lp.push(-row[1]);
        values.extend_from_slice(&row[2..]);
    }
    Ok(())
}
