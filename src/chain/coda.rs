//! CODA files, as JAGS and BUGS write them: an index with the lines of each variable, and for every chain a file of iterations and values.

use std::path::{Path, PathBuf};

use super::draws::Draws;
use crate::error::{Error, Result};

/// The index of CODA files if `path` is it or one of its chains: `CODAindex.txt`, `CODAchain1.txt`, `coda1.txt` of WinBUGS.
pub fn coda_index(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?.to_lowercase();
    let stem = name.strip_suffix(".txt")?;
    let stem = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let stem = stem
        .strip_suffix("index")
        .or_else(|| stem.strip_suffix("chain"))
        .unwrap_or(stem);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let is_index = |name: &str| name.to_lowercase() == format!("{stem}index.txt");
    let mut names = entries
        .flatten()
        .filter_map(|e| e.file_name().into_string().ok());
    names
        .find(|name| is_index(name))
        .map(|name| path.with_file_name(name))
}

/// The files beside an index that are numbered from 1 on, in whatever letters.
fn numbered(index: &Path) -> Vec<PathBuf> {
    let place = index.to_string_lossy();
    let stem = &place[..place.len() - "index.txt".len()];
    let named = |word: &str| -> Vec<PathBuf> {
        let all = (1..).map(|k| PathBuf::from(format!("{stem}{word}{k}.txt")));
        all.take_while(|path| path.is_file()).collect()
    };
    let mut found = ["chain", "Chain", ""].into_iter().map(named);
    found.find(|files| !files.is_empty()).unwrap_or_default()
}

/// Reads the chains of an index: these, or every one beside it that is numbered.
///
/// # Errors
/// The input's fault, naming file and line: no chain, lines of another kind, variables or chains of different length.
pub fn read_coda(index: &Path, chains: &[PathBuf]) -> Result<Draws> {
    let variables = lines(index, "a name with its first and last line", |words| {
        let [name, first, last] = *words else {
            return None;
        };
        Some((
            name.to_string(),
            first.parse::<usize>().ok()?,
            last.parse::<usize>().ok()?,
        ))
    })?;
    let files = match chains {
        [] => numbered(index),
        chains => chains.to_vec(),
    };
    if files.is_empty() {
        let first = index.with_file_name("CODAchain1.txt");
        return Err(Error::input(first.display(), "a CODA file of draws").found("no such file"));
    }
    let (mut values, mut known) = (Vec::new(), None);
    for place in &files {
        let rows = lines(place, "an iteration and a value", |words| {
            let [iteration, value] = *words else {
                return None;
            };
            Some((iteration.parse::<usize>().ok()?, value.parse::<f64>().ok()?))
        })?;
        let mut columns = Vec::new();
        for (name, first, last) in &variables {
            let own = first
                .checked_sub(1)
                .and_then(|first| rows.get(first..*last));
            let iterations = own.map(|own| own.iter().map(|row| row.0).collect::<Vec<usize>>());
            if own.is_none() || *known.get_or_insert(iterations.clone()) != iterations {
                let expected = format!(
                    "{name} in the lines {first} to {last}, over the iterations of all others"
                );
                return Err(Error::input(place.display(), expected)
                    .found(format!("{} lines", rows.len()))
                    .hint("a file that was cut? or monitors that were set at different times"));
            }
            columns.extend(own);
        }
        let draws = columns.first().map_or(0, |c| c.len());
        values.extend((0..draws).flat_map(|d| columns.iter().map(move |c| c[d].1)));
    }
    let names: Vec<String> = variables.into_iter().map(|(name, ..)| name).collect();
    let lp = vec![f64::NAN; values.len() / names.len().max(1)];
    Draws::new(names, (0..files.len()).collect(), values, lp)
}

/// What `of` makes of the words of every line that is not empty.
fn lines<T>(path: &Path, expected: &str, of: impl Fn(&[&str]) -> Option<T>) -> Result<Vec<T>> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::input(path.display(), "a CODA file").found(e))?;
    let numbered = text.lines().enumerate();
    let lines = numbered.filter(|(_, line)| !line.trim().is_empty());
    let made = lines.map(|(k, line)| {
        let words: Vec<&str> = line
            .split_whitespace()
            .map(|w| w.trim_matches('"'))
            .collect();
        let place = || format!("{}, line {}", path.display(), k + 1);
        of(&words).ok_or_else(|| Error::input(place(), expected).found(line))
    });
    made.collect()
}
