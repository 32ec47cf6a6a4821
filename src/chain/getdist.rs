//! GetDist files: `ROOT_N.txt` (weight, -log posterior, parameters), `ROOT.paramnames`, `ROOT.ranges`.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use super::csv::write_ensembles;
use super::draws::{Chains, Draws};
use crate::error::{Error, Result};
use crate::files;
use crate::parameter::Parameter;

fn beside(root: &Path, ending: &str) -> PathBuf {
    let mut path = root.as_os_str().to_owned();
    path.push(ending);
    PathBuf::from(path)
}

/// Writes the files, one an ensemble: its walkers, one after the other.
///
/// # Errors
/// The input's fault (with the path) if a file cannot be written.
pub fn write_getdist(chains: &dyn Chains, root: &Path) -> Result<()> {
    let (mut names, mut ranges) = (String::new(), String::new());
    let mut known = HashSet::new();
    for name in chains.names() {
        // Writing to a string cannot fail.
        let plain = plain_name(name, &mut known);
        let _ = writeln!(names, "{plain}\t{}", name.replace('_', "\\_"));
        let low = if Parameter::read(name).is_positive() {
            "0"
        } else {
            "N"
        };
        let _ = writeln!(ranges, "{plain} {low} N");
    }
    files::all_or_none(|written| {
        write_ensembles((chains, root, "txt"), |_, _| Ok(()), write_chain, written)?;
        for (ending, text) in [(".paramnames", names), (".ranges", ranges)] {
            let path = beside(root, ending);
            files::replace(&path, text)?;
            written.push(path);
        }
        Ok(())
    })
}

/// A name that GetDist can read: no blank in it, no star (of derived parameters) or question mark, and none that is known already.
fn plain_name(name: &str, known: &mut HashSet<String>) -> String {
    let letter = |c: char| {
        if c.is_whitespace() || "*?".contains(c) {
            '_'
        } else {
            c
        }
    };
    let mut plain: String = name.chars().map(letter).collect();
    while !known.insert(plain.clone()) {
        plain.push('_');
    }
    plain
}

fn write_chain(draws: &Draws, out: &mut dyn Write) -> std::io::Result<()> {
    for (point, lp) in draws.points().zip(draws.lp()) {
        write!(out, "1 {:?}", -lp)?;
        for value in point {
            write!(out, " {value:?}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The names of a chain: those of `ROOT.paramnames`, or of the first line of `ROOT.1.txt` as Cobaya writes it.
fn names(root: &Path) -> Result<Vec<String>> {
    let path = beside(root, ".paramnames");
    match std::fs::read_to_string(&path) {
        // a star marks a derived parameter
        Ok(text) => Ok(text
            .lines()
            .filter_map(|line| line.split_whitespace().next())
            .map(|name| name.trim_end_matches('*').to_string())
            .collect()),
        Err(e) => header(root)
            .ok_or_else(|| Error::input(path.display(), "the names of a GetDist chain").found(e)),
    }
}

/// The names in the first line of `ROOT.1.txt`: `# weight minuslogpost NAME ...`.
fn header(root: &Path) -> Option<Vec<String>> {
    let file = std::fs::File::open(beside(root, ".1.txt")).ok()?;
    let mut line = String::new();
    BufReader::new(file)
        .take(1 << 20)
        .read_line(&mut line)
        .ok()?;
    let mut words = line.strip_prefix('#')?.split_whitespace();
    let begins = ["weight", "minuslogpost"].map(|word| words.next() == Some(word));
    (begins == [true; 2]).then(|| words.map(String::from).collect())
}

/// No chain stays in one place for so many steps, and no memory holds as many draws.
const MOST_WEIGHT: f64 = 1e7;

/// Whether there are the names of chains at this root.
pub fn is_getdist(root: &Path) -> bool {
    beside(root, ".paramnames").is_file() || header(root).is_some()
}

/// Reads `ROOT_1.txt`, `ROOT_2.txt`, ..., or `ROOT.txt` alone, with `ROOT.paramnames`. Weights are repetitions, as Metropolis writes them.
///
/// # Errors
/// The input's fault, naming file and line: missing files, a weight that is no whole number, chains of different length.
pub fn read_getdist(root: &Path) -> Result<Draws> {
    let names = names(root)?;
    let mut chains: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let places = chain_files(root)?;
    for place in &places {
        let text = std::fs::read_to_string(place)
            .map_err(|e| Error::input(place.display(), "a GetDist chain, UTF-8 text").found(e))?;
        let (mut values, mut lp) = (Vec::new(), Vec::new());
        for (index, line) in text.lines().enumerate() {
            read_line(line, &names, &mut values, &mut lp)
                .map_err(|e| e.within(format!("{}, line {}", place.display(), index + 1)))?;
        }
        chains.push((values, lp));
    }
    let lengths = || chains.iter().map(|(_, lp)| lp.len());
    let (shortest, longest) = (lengths().min().unwrap_or(0), lengths().max().unwrap_or(0));
    if 2 * shortest < longest {
        let short = lengths().position(|n| n == shortest).unwrap_or(0);
        let expected = format!("at least half as many draws as in the longest chain, {longest}");
        return Err(Error::input(places[short].display(), expected)
            .found(shortest)
            .hint("a chain that was stopped has fewer: leave it out"));
    }
    let (mut values, mut lp) = (Vec::new(), Vec::new());
    for (own, density) in &chains {
        let first = density.len() - shortest;
        values.extend_from_slice(&own[first * names.len()..]);
        lp.extend_from_slice(&density[first..]);
    }
    let mut draws = Draws::new(names, (0..chains.len()).collect(), values, lp)?;
    if shortest < longest {
        draws.info.remarks.push(format!(
            "chains of {shortest} to {longest} draws: the last {shortest} of each are taken"
        ));
    }
    Ok(draws)
}

/// The files of a root's chains: GetDist and CosmoMC write `ROOT_1.txt`, Cobaya `ROOT.1.txt`; a single one is `ROOT.txt`.
fn chain_files(root: &Path) -> Result<Vec<PathBuf>> {
    const MOST: usize = 1000;
    let numbered = ["_", "."].map(|between| {
        let all = (0..MOST).map(|k| beside(root, &format!("{between}{k}.txt")));
        all.filter(|place| place.is_file()).collect()
    });
    let single = Some(beside(root, ".txt")).filter(|place| place.is_file());
    let mut found = numbered.into_iter().chain([Vec::from_iter(single)]);
    found.find(|places| !places.is_empty()).ok_or_else(|| {
        let expected = "a GetDist chain, ROOT_1.txt or ROOT.txt, or ROOT.1.txt of Cobaya";
        Error::input(beside(root, "_1.txt").display(), expected).found("no such file")
    })
}

fn read_line(line: &str, names: &[String], values: &mut Vec<f64>, lp: &mut Vec<f64>) -> Result<()> {
    if line.trim_start().starts_with('#') {
        return Ok(());
    }
    let row: std::result::Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
    let row = row.map_err(|e| Error::input("row", "numbers").found(e))?;
    if row.is_empty() {
        return Ok(());
    }
    if row.len() != names.len() + 2 {
        return Err(Error::input("row", format!("{} numbers", names.len() + 2)).found(row.len()));
    }
    let weight = row[0];
    if weight.fract() != 0.0 || !(0.0..MOST_WEIGHT).contains(&weight) {
        return Err(Error::input("weight", "a whole number of repetitions")
            .found(weight)
            .hint("these are reweighted or nested samples, not a chain: draw samples of equal weight from them first"));
    }
    for _ in 0..weight as usize {
        lp.push(-row[1]);
        values.extend_from_slice(&row[2..]);
    }
    Ok(())
}
