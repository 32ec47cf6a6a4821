//! What keeps the sources readable, measured: the length of functions, the values they take, types spread over files, names that stand twice,
//! and the size of the whole. Limits are maxima, and may only fall.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Functions of more than [`LINES`] lines.
const LONG_FUNCTIONS: usize = 0;
const LINES: usize = 80;

/// Functions of more than [`VALUES`] values in their parameters; members of tuples count.
const WIDE_FUNCTIONS: usize = 0;
const VALUES: usize = 6;

/// Types whose own `impl` blocks stand in more than two files.
const SPREAD_TYPES: usize = 0;

/// Type names that stand twice.
const NAMES_TWICE: usize = 0;

/// The size of `src` in what a reader has to hold: tokens (so that layout does not count), types, and values that may be absent.
const SIZE: Size = Size {
    tokens: 704_980,
    types: 950,
    options: 524,
};

/// A file of `src`: its path, its text, and the text with comments, strings and characters blanked.
struct Source {
    path: String,
    text: String,
    code: String,
}

fn collect(folder: &Path, root: &Path, found: &mut Vec<Source>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, root, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let path = path.strip_prefix(root).unwrap().display().to_string();
            let code = blanked(&text);
            found.push(Source { path, text, code });
        }
    }
}

fn all() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    collect(&root, &root, &mut found);
    assert!(found.len() > 100, "the sources are where they should be");
    found
}

/// The end of what begins at `rest` and has no structure: a comment, a string, a character. None if it is code.
fn literal(rest: &[u8], after_word: bool) -> Option<usize> {
    let find = |what: &[u8], from: usize| {
        let at = rest[from..].windows(what.len()).position(|w| w == what);
        at.map_or(rest.len(), |k| from + k + what.len())
    };
    match rest {
        [b'/', b'/', ..] => Some(find(b"\n", 0) - 1),
        [b'/', b'*', ..] => Some(find(b"*/", 2)),
        [b'"', ..] => {
            let mut at = 1;
            while at < rest.len() && rest[at] != b'"' {
                at += 1 + usize::from(rest[at] == b'\\');
            }
            Some(at + 1)
        }
        [b'r', b'"' | b'#', ..] if !after_word => {
            let hashes = rest[1..].iter().take_while(|c| **c == b'#').count();
            (rest.get(1 + hashes) == Some(&b'"')).then(|| {
                let end = [&b"\""[..], &rest[1..1 + hashes]].concat();
                find(&end, 2 + hashes)
            })
        }
        [b'\'', b'\\', ..] => Some(find(b"'", 3)),
        [b'\'', ..] => {
            // a lifetime has no closing quote after one character
            let width = std::str::from_utf8(&rest[1..rest.len().min(5)])
                .map_or(1, |s| s.chars().next().map_or(1, char::len_utf8));
            (rest.get(1 + width) == Some(&b'\'')).then_some(2 + width)
        }
        _ => None,
    }
}

fn blanked(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = bytes.to_vec();
    let mut at = 0;
    while at < bytes.len() {
        let after_word = at > 0 && (bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_');
        let Some(length) = literal(&bytes[at..], after_word) else {
            at += 1;
            continue;
        };
        let blanks = out[at..].iter_mut().take(length);
        blanks.filter(|c| **c != b'\n').for_each(|c| *c = b' ');
        at += length.max(1);
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// The place of the bracket that closes the one at `open`.
fn closing(code: &str, open: usize) -> usize {
    let mut depth = 0;
    for (k, c) in code.bytes().enumerate().skip(open) {
        depth += i32::from(b"([{".contains(&c)) - i32::from(b")]}".contains(&c));
        if depth == 0 {
            return k;
        }
    }
    code.len()
}

/// The parts of a list, at commas outside of all brackets.
fn parts(list: &str, at: char) -> Vec<&str> {
    let (mut depth, mut begin, mut before) = (0, 0, ' ');
    let mut found = Vec::new();
    for (k, c) in list.char_indices() {
        let arrow = c == '>' && (before == '-' || before == '=');
        depth += i32::from("([{<".contains(c)) - i32::from(")]}>".contains(c) && !arrow);
        if c == at && depth == 0 {
            found.push(list[begin..k].trim());
            begin = k + 1;
        }
        before = c;
    }
    found.push(list[begin..].trim());
    found.retain(|part| !part.is_empty());
    found
}

fn members(mut of: &str) -> usize {
    loop {
        let rest = of.trim_start_matches('&').trim_start();
        let rest = match rest.strip_prefix('\'') {
            Some(lifetime) => {
                lifetime.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_')
            }
            None => rest,
        };
        let rest = rest.trim_start();
        let rest = rest.strip_prefix("mut ").unwrap_or(rest).trim();
        if rest == of {
            break;
        }
        of = rest;
    }
    if of.starts_with('(') && closing(of, 0) == of.len() - 1 {
        return parts(&of[1..of.len() - 1], ',')
            .into_iter()
            .map(members)
            .sum();
    }
    1
}

fn values(parameters: &str) -> usize {
    let one = |parameter: &str| {
        let both = parts(parameter, ':');
        match both[..] {
            [pattern, .., kind] if !pattern.ends_with("self") => {
                members(pattern).max(members(kind))
            }
            _ => 0,
        }
    };
    parts(&parameters.replace("::", "__"), ',')
        .into_iter()
        .map(one)
        .sum()
}

/// A function: its place, lines and the values that it takes.
struct Function {
    place: String,
    lines: usize,
    values: usize,
}

fn functions(source: &Source) -> Vec<Function> {
    let code = &source.code;
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    for (at, _) in code.match_indices("fn ") {
        let name = code[at + 3..].trim_start();
        let begins = !code[..at].ends_with(is_word) && name.starts_with(is_word);
        let line_of = |k: usize| code[..k].matches('\n').count() + 1;
        let mut open = at + 3 + code[at + 3..].find(['(', '<']).unwrap_or(0);
        if !begins {
            continue;
        }
        if code[open..].starts_with('<') {
            let (mut depth, mut before) = (0, ' ');
            for (k, c) in code[open..].char_indices() {
                depth += i32::from(c == '<') - i32::from(c == '>' && before != '-');
                before = c;
                if depth == 0 {
                    open += k + 1;
                    break;
                }
            }
            open += code[open..].find('(').unwrap_or(0);
        }
        let end = closing(code, open);
        let Some(body) = code[end..].find(['{', ';']).map(|k| end + k) else {
            continue;
        };
        let last = if code[body..].starts_with('{') {
            closing(code, body)
        } else {
            body
        };
        let name: String = name.chars().take_while(|c| is_word(*c)).collect();
        found.push(Function {
            place: format!("{}:{} {name}", source.path, line_of(at)),
            lines: line_of(last) - line_of(at) + 1,
            values: values(&code[open + 1..end]),
        });
    }
    found
}

fn at_most(limit: usize, what: &str, found: &[String]) {
    let list = found.join("\n  ");
    let count = found.len();
    assert!(count <= limit, "{count} {what}, at most {limit}:\n  {list}");
}

#[test]
fn functions_fit_on_a_screen() {
    let found: Vec<Function> = all().iter().flat_map(functions).collect();
    assert!(found.len() > 2000, "only {} functions seen", found.len());
    let long = found.iter().filter(|f| f.lines > LINES);
    let long: Vec<String> = long
        .map(|f| format!("{} {} lines", f.place, f.lines))
        .collect();
    at_most(LONG_FUNCTIONS, "functions of more than 80 lines", &long);
    let wide = found.iter().filter(|f| f.values > VALUES);
    let wide: Vec<String> = wide
        .map(|f| format!("{} {} values", f.place, f.values))
        .collect();
    at_most(WIDE_FUNCTIONS, "functions of more than 6 values", &wide);
}

/// Names of types, those within functions among them, by the files that define them.
fn types(sources: &[Source]) -> BTreeMap<String, Vec<&str>> {
    let mut found: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for source in sources {
        for line in source.code.lines() {
            // within a block, a `type` is a trait's
            let is_inner = line.starts_with(' ');
            let mut words = line
                .trim_start()
                .split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '('));
            let kind = words.find(|w| {
                let before = ["", "pub", "(crate", "pub(crate", "pub(super", "pub(in"];
                !before.contains(w)
            });
            let is_type = |k| ["struct", "enum", "trait", "union"].contains(&k);
            if kind.is_some_and(|k| is_type(k) || k == "type" && !is_inner) {
                let name = words.find(|w| !w.is_empty()).unwrap_or_default();
                let name = name
                    .trim_end_matches('(')
                    .split('(')
                    .next()
                    .unwrap_or_default();
                found
                    .entry(name.to_string())
                    .or_default()
                    .push(&source.path);
            }
        }
    }
    found
}

#[test]
fn names_of_types_stand_once_and_types_in_few_files() {
    let sources = all();
    let types = types(&sources);
    assert!(types.len() > 500, "only {} types seen", types.len());
    let twice = types.iter().filter(|(_, files)| files.len() > 1);
    let twice: Vec<String> = twice
        .map(|(name, files)| format!("{name}: {}", files.join(" ")))
        .collect();
    at_most(NAMES_TWICE, "names of types that stand twice", &twice);

    let mut homes: BTreeMap<(String, &str), BTreeSet<&str>> = BTreeMap::new();
    let room = |path: &str| path.split('/').next().unwrap_or_default().to_string();
    for source in &sources {
        for block in source.code.split("\nimpl").skip(1) {
            let head = block.split('{').next().unwrap_or_default();
            let head = if head.starts_with('<') {
                head.split_once("> ").map_or("", |h| h.1)
            } else {
                head
            };
            let name: String = head
                .trim()
                .chars()
                .take_while(|c| c.is_alphanumeric())
                .collect();
            let Some(files) = types.get(&name).filter(|_| !head.contains(" for ")) else {
                continue;
            };
            let near = |f: &&&str| **f == source.path;
            let same_room = |f: &&&str| room(f) == room(&source.path);
            let home = files
                .iter()
                .find(near)
                .or_else(|| files.iter().find(same_room));
            let home = home.unwrap_or(&files[0]);
            homes.entry((name, home)).or_default().insert(&source.path);
        }
    }
    let spread = homes.iter().filter(|(_, files)| files.len() > 2);
    let spread: Vec<String> = spread
        .map(|((name, _), files)| format!("{name}: {files:?}"))
        .collect();
    at_most(SPREAD_TYPES, "types in more than two files", &spread);
}

/// Tokens are identifiers, numbers, strings and operators outside of comments; types are structs, enums and traits; options are fields and
/// parameters of type `Option<..>`.
#[derive(Debug, PartialEq)]
struct Size {
    tokens: usize,
    types: usize,
    options: usize,
}

/// The number of bytes of the token, comment or white space at the beginning, and whether it is a token.
fn next_token(text: &str) -> (usize, bool) {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let word = |from: usize| {
        let end = text[from..].find(|c| !is_word(c));
        end.map_or(text.len(), |k| from + k)
    };
    let first = text.chars().next().unwrap_or(' ');
    if first.is_whitespace() {
        return (first.len_utf8(), false);
    }
    let after_b = text.strip_prefix('b').unwrap_or(text);
    let begins_raw = after_b.strip_prefix('r').is_some_and(|rest| {
        let rest = rest.trim_start_matches('#');
        rest.starts_with('"')
    });
    if text.starts_with("//") || text.starts_with("/*") {
        return (literal(text.as_bytes(), false).unwrap_or(1).max(1), false);
    }
    if begins_raw || after_b.starts_with('"') {
        let b = text.len() - after_b.len();
        let length = literal(after_b.as_bytes(), false);
        return (b + length.unwrap_or(1), true);
    }
    if first == '\'' {
        let closed = literal(text.as_bytes(), false);
        return (closed.unwrap_or_else(|| word(1)), true);
    }
    if is_word(first) {
        let end = word(0);
        let fraction = text[end..].strip_prefix('.');
        let goes_on = fraction.is_some_and(|f| f.starts_with(|c: char| c.is_ascii_digit()));
        return (if goes_on { word(end + 1) } else { end }, true);
    }
    let two = text.get(..2).unwrap_or_default();
    let length = match two {
        ".." if text[2..].starts_with('=') => 3,
        "::" | "->" | "=>" | ".." | "&&" | "||" => 2,
        _ if two.ends_with('=') && "-+*/%^&|<>=!".contains(first) => 2,
        _ => first.len_utf8(),
    };
    (length, true)
}

/// How often a line begins with the words, after blanks and what says who may see it.
fn definitions(lines: &[&str], kinds: [&str; 3]) -> usize {
    let begins = |line: &&&str| {
        let line = line.trim_start();
        let line = match line.strip_prefix("pub") {
            Some(rest) if rest.starts_with('(') => rest.split_once(") ").map_or("", |r| r.1),
            Some(rest) if rest.starts_with(' ') => &rest[1..],
            _ => line,
        };
        kinds.iter().any(|kind| line.starts_with(kind))
    };
    lines.iter().filter(begins).count()
}

fn size(sources: &[Source]) -> Size {
    let mut size = Size {
        tokens: 0,
        types: 0,
        options: 0,
    };
    for source in sources {
        let mut rest = source.text.as_str();
        while !rest.is_empty() {
            let (length, counts) = next_token(rest);
            size.tokens += usize::from(counts);
            rest = &rest[length..];
        }
        let lines = source.text.lines();
        let lines: Vec<&str> = lines.map(|l| l.split("//").next().unwrap_or("")).collect();
        size.types += definitions(&lines, ["struct ", "enum ", "trait "]);
        let code = lines.join("\n");
        let typed = code.split(':').skip(1);
        size.options += typed
            .filter(|after| after.trim_start().starts_with("Option<"))
            .count();
    }
    size
}

#[test]
fn the_sources_do_not_grow() {
    let size = size(&all());
    let within =
        size.tokens <= SIZE.tokens && size.types <= SIZE.types && size.options <= SIZE.options;
    assert!(within, "{size:?}, at most {SIZE:?}");
}

/// The same counts by the project's tool, which shares no code with this file.
#[test]
#[ignore = "needs ../shared"]
fn sizes_are_those_of_the_tool() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tool = root.join("../shared/tools/size");
    let output = crate::common::python().arg(tool).current_dir(root).output();
    let text = String::from_utf8(output.unwrap().stdout).unwrap();
    let last: Vec<&str> = text.lines().last().unwrap().split_whitespace().collect();
    let [tokens, types, options] = [3, 4, 5].map(|k| last[k].parse().unwrap());
    let expected = Size {
        tokens,
        types,
        options,
    };
    assert_eq!(size(&all()), expected);
}
