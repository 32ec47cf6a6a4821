//! Imports run one way, and nothing of the machine gets into the repository.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules from left to right: each may use only those to its left.
const ORDER: [&[&str]; 26] = [
    &[
        "dense",
        "error",
        "files",
        "lanes",
        "numeric",
        "parameter",
        "progress",
        "quantity",
        "signals",
    ],
    &["section"],
    &["chain"],
    &["sample"],
    &["diagnose"],
    &["bridge"],
    &["laminate"],
    &["geometry"],
    &["mesh_files"],
    &["field"],
    &["noise"],
    &["fem"],
    &["effect"],
    &["experiment"],
    &["reduce"],
    &["infer"],
    &["linearise"],
    &["posterior"],
    &["identify"],
    &["trace"],
    &["study"],
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

/// The map names files and functions that exist: each function in one of the files of its line.
#[test]
fn the_map_of_the_sources_leads_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let map = fs::read_to_string(root.join("src/README.md")).unwrap();
    let mut places = 0;
    for line in map.lines() {
        let quoted = || line.split('`').skip(1).step_by(2);
        let is_path = |k: &&str| !k.contains(' ') && (k.ends_with(".rs") || k.ends_with('/'));
        let mut code = String::new();
        for path in quoted().filter(is_path) {
            let place = match path.starts_with("tests/") {
                true => root.join(path),
                false => root.join("src").join(path),
            };
            assert!(place.exists(), "{path} is not there: {line}");
            if place.is_file() {
                code += &fs::read_to_string(place).unwrap();
            }
            places += 1;
        }
        for name in quoted().filter_map(|k| k.strip_suffix("()")) {
            let defined = [format!("fn {name}("), format!("fn {name}<")];
            let is_there = defined.iter().any(|d| code.contains(d));
            assert!(is_there, "no function {name} where {line} says");
        }
    }
    assert!(places > 60, "{places} places");
}

/// Circles of files that import each other. The registries (`effect`, `geometry`) and the verbs of `cli` are three: each lists
/// files that use what stands beside the list.
const CIRCLES: usize = 6;

/// The modules of the crate: path from the root, and the code without comments and without tests of its own.
fn modules() -> BTreeMap<Vec<String>, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    sources(&root, &mut found);
    let mut modules = BTreeMap::new();
    for path in found {
        let inside = path.strip_prefix(&root).unwrap().with_extension("");
        let mut place: Vec<String> = inside
            .iter()
            .map(|part| part.to_str().unwrap().to_string())
            .filter(|part| part != "mod")
            .collect();
        if place == ["lib"] || place == ["main"] {
            place.clear();
        }
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        let lines = code.lines().map(|l| l.split("//").next().unwrap());
        modules.insert(place, lines.collect::<Vec<_>>().join("\n"));
    }
    modules.remove(&Vec::new());
    modules
}

/// Paths of a `use` with its braces written out.
fn written_out(tree: &str) -> Vec<String> {
    let Some((before, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap();
        return vec![path.split_whitespace().collect()];
    };
    let inside = &rest[..rest.rfind('}').unwrap()];
    let mut depth = 0;
    let mut parts = vec![String::new()];
    for c in inside.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            parts.push(String::new());
        } else {
            parts.last_mut().unwrap().push(c);
        }
    }
    parts
        .iter()
        .filter(|part| !part.trim().is_empty())
        .flat_map(|part| written_out(&format!("{before}{}", part.trim())))
        .collect()
}

/// Paths that a module names, and those that it hands on with `pub use`.
fn named(code: &str) -> (Vec<String>, Vec<String>) {
    let (mut used, mut handed_on) = (Vec::new(), Vec::new());
    let mut rest = String::new();
    for statement in code.split_inclusive(';') {
        let words = statement.trim().trim_end_matches(';');
        let Some((before, tree)) = words.rsplit_once("use ").filter(|(before, _)| {
            let last = before.lines().last().unwrap_or("").trim();
            last.is_empty() || last.starts_with("pub")
        }) else {
            rest += statement;
            continue;
        };
        let public = before.lines().last().is_some_and(|l| l.contains("pub"));
        let list = if public { &mut handed_on } else { &mut used };
        list.extend(written_out(tree));
        rest += before;
    }
    let part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let paths = rest.split(|c| !part(c)).filter(|p| p.contains("::"));
    used.extend(paths.map(|p| p.trim_matches(':').to_string()));
    (used, handed_on)
}

/// A path from the root, if it begins in the crate.
fn absolute(
    modules: &BTreeMap<Vec<String>, String>,
    from: &[String],
    path: &str,
) -> Option<Vec<String>> {
    let mut parts: Vec<String> = path.split("::").map(String::from).collect();
    let mut base = from.to_vec();
    match parts[0].as_str() {
        "crate" => base.clear(),
        "super" => {
            while parts.first().is_some_and(|p| p == "super") {
                base.pop();
                parts.remove(0);
            }
            return Some([base, parts].concat());
        }
        "self" => {}
        child => {
            base.push(child.to_string());
            if !modules.contains_key(&base) {
                return None;
            }
        }
    }
    parts.remove(0);
    Some([base, parts].concat())
}

/// The module that defines what a path names, following what modules hand on.
fn defined(
    modules: &BTreeMap<Vec<String>, String>,
    handed_on: &BTreeMap<Vec<String>, Vec<String>>,
    path: &[String],
    depth: usize,
) -> Option<Vec<String>> {
    let length = (1..=path.len()).rev();
    let length = length
        .into_iter()
        .find(|&k| modules.contains_key(&path[..k]))?;
    let module = path[..length].to_vec();
    let Some(name) = path.get(length).filter(|_| depth < 6) else {
        return Some(module);
    };
    let through = handed_on[&module]
        .iter()
        .filter(|p| p.rsplit("::").next() == Some(name))
        .filter_map(|p| absolute(modules, &module, p))
        .find_map(|p| defined(modules, handed_on, &p, depth + 1));
    Some(through.unwrap_or(module))
}

#[test]
fn circles_of_files_stay_few_and_inside_rooms() {
    let modules = modules();
    let mut used = BTreeMap::new();
    let mut handed_on = BTreeMap::new();
    for (module, code) in &modules {
        let (uses, hands_on) = named(code);
        used.insert(module.clone(), uses);
        handed_on.insert(module.clone(), hands_on);
    }
    let mut imports: BTreeMap<&Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for (module, uses) in &used {
        let targets = uses.iter().filter_map(|p| {
            let path = absolute(&modules, module, p)?;
            defined(&modules, &handed_on, &path, 0)
        });
        imports.insert(module, targets.filter(|t| t != module).collect());
    }
    let direct: usize = imports.values().map(BTreeSet::len).sum();
    assert!(direct > 400, "only {direct} imports seen");
    // everything that can be reached
    let reach: BTreeMap<&Vec<String>, BTreeSet<&Vec<String>>> = modules
        .keys()
        .map(|module| {
            let mut reached = BTreeSet::new();
            let mut open = vec![module];
            while let Some(at) = open.pop() {
                open.extend(imports[at].iter().filter(|t| reached.insert(*t)));
            }
            (module, reached)
        })
        .collect();
    let circles: BTreeSet<Vec<&Vec<String>>> = modules
        .keys()
        .filter(|m| reach[m].contains(*m))
        .map(|m| {
            let reached = reach[m].iter().copied();
            reached.filter(|t| reach[t].contains(m)).collect()
        })
        .collect();
    for circle in &circles {
        assert!(
            circle.iter().all(|m| m[0] == circle[0][0]),
            "files of different rooms import each other in a circle: {circle:?}"
        );
    }
    assert!(
        circles.len() <= CIRCLES,
        "{} circles: {circles:#?}",
        circles.len()
    );
    // of the same kind: the code sees what it is there to see
    let registry = circles.iter().find(|c| c[0][0] == "effect").unwrap();
    let kinds: BTreeSet<_> = plychain::effect::EFFECTS
        .iter()
        .map(|e| e.name().trim_end_matches(char::is_numeric))
        .collect();
    assert!(registry.len() > kinds.len());
}

/// An entry is a file of its room and a line of the room's registry.
#[test]
fn every_file_of_a_registry_is_listed() {
    for (room, of, list, length) in [
        (
            "effect",
            "Effect",
            "EFFECTS",
            plychain::effect::EFFECTS.len(),
        ),
        (
            "geometry",
            "Geometry",
            "GEOMETRIES",
            plychain::geometry::GEOMETRIES.len(),
        ),
        ("field", "Reader", "READERS", plychain::field::READERS.len()),
        (
            "campaign",
            "Engine",
            "ENGINES",
            plychain::campaign::ENGINES.len(),
        ),
    ] {
        let modules = modules();
        // a specimen of a mesh file is made from that, and listed nowhere
        let listed = |m: &[String]| m[0] == room;
        let files: Vec<_> = modules.iter().filter(|(m, _)| listed(m)).collect();
        let begin = format!("{list}: &[");
        let listing = files.iter().find_map(|(_, code)| code.split(&begin).nth(1));
        let (_, listing) = listing.unwrap().split_once("= &[").unwrap();
        let lines: Vec<&str> = listing.split(']').next().unwrap().split(',').collect();
        let mut entries = 0;
        for (module, code) in files {
            let opening = format!("impl {of} for ");
            let types: Vec<&str> = code.split(&opening).skip(1).collect();
            let Some(name) = types.first().and_then(|t| t.split_whitespace().next()) else {
                continue;
            };
            assert_eq!(types.len(), 1, "{module:?} is several entries of {list}");
            let within = format!("{}::", module[module.len() - 1]);
            let found = lines.iter().map(|l| l.trim().trim_start_matches('&'));
            let found = found.filter(|l| l.starts_with(&within) || *l == name);
            // one type may stand for several entries
            let count = found.count();
            assert!(count > 0, "{module:?} in {list}");
            entries += count;
        }
        assert_eq!(entries, length, "{list}");
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
