//! File patterns: `*` for any characters and `?` for one, in every part of a path.

use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern, glob_with};

use crate::error::{Error, Result};
use crate::files::natural;

/// The files and folders that paths and patterns name below `base`, in order, those of a pattern sorted with numbers, decimals too, by their size.
///
/// # Errors
/// The input's fault, at `key`: a pattern that nothing matches.
pub fn expand(patterns: &[String], base: &Path, key: &str) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for pattern in patterns {
        if !pattern.contains(['*', '?']) {
            all.push(base.join(pattern));
            continue;
        }
        let found = matching(pattern, base);
        if found.is_empty() {
            return Err(Error::input(key, "files that match").found(pattern));
        }
        all.extend(found);
    }
    Ok(all)
}

fn matching(pattern: &str, base: &Path) -> Vec<PathBuf> {
    const AS_A_SHELL: MatchOptions = MatchOptions {
        case_sensitive: true,
        require_literal_separator: true,
        require_literal_leading_dot: true,
    };
    let base = Pattern::escape(&base.to_string_lossy());
    // sets of characters are no part of the patterns
    let pattern = Path::new(&base).join(pattern.replace('[', "[[]"));
    let paths = glob_with(&pattern.to_string_lossy(), AS_A_SHELL);
    let mut found: Vec<PathBuf> = paths.into_iter().flatten().flatten().collect();
    found.sort_by(|a, b| {
        let parts = a.iter().zip(b.iter());
        let mut orders = parts.map(|(x, y)| natural(&x.to_string_lossy(), &y.to_string_lossy()));
        orders
            .find(|order| order.is_ne())
            .unwrap_or_else(|| a.cmp(b))
    });
    found
}
