//! File patterns: `*` for any characters and `?` for one, in every part of a path.

use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};

/// The files and folders that paths and patterns name below `base`, in order, those of a pattern sorted with numbers by their size.
///
/// # Errors
/// The input's fault, at `key`: a pattern that nothing matches.
pub fn expand(patterns: &[String], base: &Path, key: &str) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for pattern in patterns {
        if !has_wildcard(pattern) {
            all.push(base.join(pattern));
            continue;
        }
        let found = matching(&base.join(pattern));
        if found.is_empty() {
            return Err(Error::input(key, "files that match").found(pattern));
        }
        all.extend(found);
    }
    Ok(all)
}

fn has_wildcard(text: &str) -> bool {
    text.contains(['*', '?'])
}

fn matching(pattern: &Path) -> Vec<PathBuf> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let text = part.as_os_str().to_string_lossy();
        let Component::Normal(_) = part else {
            found.iter_mut().for_each(|p| p.push(part));
            continue;
        };
        if !has_wildcard(&text) {
            found.iter_mut().for_each(|p| p.push(part));
            found.retain(|p| p.exists());
            continue;
        }
        let within = |folder: &PathBuf| {
            let here = match folder.as_os_str().is_empty() {
                true => Path::new("."),
                false => folder,
            };
            let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
            let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
            let mut names: Vec<String> = names
                .filter(|n| !n.starts_with('.') && fits(text.as_bytes(), n.as_bytes()))
                .collect();
            names.sort_by_key(|n| natural(n));
            names
                .into_iter()
                .map(|n| folder.join(n))
                .collect::<Vec<_>>()
        };
        found = found.iter().flat_map(within).collect();
    }
    found
}

/// Whether a name is of a pattern.
fn fits(pattern: &[u8], name: &[u8]) -> bool {
    match (pattern, name) {
        ([], []) => true,
        ([b'*', rest @ ..], _) => (0..=name.len()).any(|k| fits(rest, &name[k..])),
        ([b'?', rest @ ..], [_, left @ ..]) => fits(rest, left),
        ([p, rest @ ..], [n, left @ ..]) if p == n => fits(rest, left),
        _ => false,
    }
}

/// A name with its numbers filled up, so that coupon-9 comes before coupon-10.
fn natural(name: &str) -> (String, String) {
    let mut key = String::new();
    let mut digits = String::new();
    for c in name.chars().chain(std::iter::once(' ')) {
        if c.is_ascii_digit() {
            digits.push(c);
            continue;
        }
        if !digits.is_empty() {
            key += &format!("{digits:0>20}");
            digits.clear();
        }
        key.push(c);
    }
    (key, name.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_those_of_a_shell() {
        for (pattern, name, fit) in [
            ("coupon-*.json", "coupon-7.json", true),
            ("coupon-*.json", "coupon-.json", true),
            ("coupon-*.json", "coupon-7.csv", false),
            ("c?.json", "c1.json", true),
            ("c?.json", "c12.json", false),
            ("*a*b", "xaxxab", true),
        ] {
            assert_eq!(
                fits(pattern.as_bytes(), name.as_bytes()),
                fit,
                "{pattern} {name}"
            );
        }
        let mut names = vec!["c10", "c9", "c09", "b100"];
        names.sort_by_key(|n| natural(n));
        assert_eq!(names, ["b100", "c09", "c9", "c10"]);
    }

    #[test]
    fn a_pattern_finds_files_in_folders() {
        let place = tempfile::tempdir().unwrap();
        for name in ["a/x-10.csv", "a/x-2.csv", "b/x-1.csv", "b/y.txt"] {
            let path = place.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = expand(&["*/x-*.csv".into()], place.path(), "data").unwrap();
        let expected = ["a/x-2.csv", "a/x-10.csv", "b/x-1.csv"].map(|n| place.path().join(n));
        assert_eq!(found, expected);
        let none = expand(&["*.json".into()], place.path(), "models").unwrap_err();
        assert!(none.to_string().contains("*.json"), "{none}");
    }
}
