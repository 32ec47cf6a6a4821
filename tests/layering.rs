//! Imports run one way, files stay small, and nothing of the machine gets into the repository.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules from left to right: each may use only those to its left.
const ORDER: [&[&str]; 19] = [
    &["error", "files", "numeric", "quantity", "progress"],
    &["field", "laminate"],
    &["noise"],
    &["geometry"],
    &["fem"],
    &["effect"],
    &["experiment"],
    &["reduce"],
    &["infer"],
    &["chain"],
    &["sample"],
    &["diagnose"],
    &["identify"],
    &["trace"],
    &["validate"],
    &["report"],
    &["campaign"],
    &["cli"],
    &["main", "lib"],
];

fn sources(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

fn all_sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    sources(&root, &mut found);
    assert!(found.len() > 40, "the sources are where they should be");
    found
        .iter()
        .map(|path| {
            let module = path
                .strip_prefix(&root)
                .unwrap()
                .components()
                .next()
                .unwrap();
            let module = module.as_os_str().to_str().unwrap().trim_end_matches(".rs");
            (module.to_string(), fs::read_to_string(path).unwrap())
        })
        .collect()
}

fn rank(module: &str) -> Option<usize> {
    ORDER.iter().position(|layer| layer.contains(&module))
}

#[test]
fn imports_point_only_to_the_left() {
    let mut seen = 0;
    for (module, text) in all_sources() {
        let own = rank(&module).unwrap_or_else(|| panic!("{module} has no place in the order"));
        for (at, _) in text.match_indices("crate::") {
            let used: String = text[at + 7..]
                .chars()
                .take_while(|c| c.is_ascii_lowercase() || *c == '_')
                .collect();
            let Some(other) = rank(&used) else { continue };
            seen += 1;
            assert!(
                other <= own,
                "{module} uses {used}, which lies to its right"
            );
        }
    }
    assert!(seen > 50, "only {seen} imports seen");
}

#[test]
fn files_stay_readable() {
    for (module, text) in all_sources() {
        let lines = text.lines().count();
        assert!(
            lines <= 450,
            "a file of {module} has {lines} lines: it is really two"
        );
    }
}

#[test]
fn no_unwrap_outside_tests() {
    for (module, text) in all_sources() {
        let code = text.split("#[cfg(test)]").next().unwrap();
        for forbidden in [
            ".unwrap()",
            ".expect(",
            "panic!(",
            "todo!(",
            "unimplemented!(",
        ] {
            assert!(!code.contains(forbidden), "{module} has {forbidden}");
        }
    }
}
