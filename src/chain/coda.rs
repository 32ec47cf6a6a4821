//! CODA files, as JAGS and BUGS write them: an index with the lines of each variable, and for every chain a file of iterations and values.

use std::path::{Path, PathBuf};

use super::draws::Draws;
use crate::error::{Error, Result};

/// The index of CODA files if `path` is it or one of its chains: `CODAindex.txt`, `CODAchain1.txt`.
pub fn coda_index(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?.strip_suffix(".txt")?;
    let at = name.rfind("index").or_else(|| name.rfind("chain"))?;
    let index = path.with_file_name(format!("{}index.txt", &name[..at]));
    index.is_file().then_some(index)
}

/// Reads the chains beside an index, every one that is numbered from 1 on.
///
/// # Errors
/// The input's fault, naming file and line: no chain, lines of another kind, variables or chains of different length.
pub fn read_coda(index: &Path) -> Result<Draws> {
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
    let stem = index.to_string_lossy().replace("index.txt", "chain");
    let (mut values, mut chains, mut known) = (Vec::new(), 0, None);
    loop {
        let place = PathBuf::from(format!("{stem}{}.txt", chains + 1));
        if chains > 0 && !place.is_file() {
            break;
        }
        let rows = lines(&place, "an iteration and a value", |words| {
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
        chains += 1;
    }
    let names: Vec<String> = variables.into_iter().map(|(name, ..)| name).collect();
    let lp = vec![f64::NAN; values.len() / names.len().max(1)];
    Draws::new(names, (0..chains).collect(), values, lp)
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
