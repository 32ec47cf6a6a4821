//! What a person reads first is measured: the words of each sentence of README and of the manuals, the size of README, and private words that a
//! page uses without saying what they mean.

use std::fs;
use std::path::{Path, PathBuf};

const PAGES: [&str; 3] = ["README.md", "models/README.md", "runs/README.md"];

/// Most words of a sentence, on average over a page.
const MEAN: f64 = 18.0;
/// Most words of any sentence of a manual, and of README.
const LONGEST: usize = 30;
const LONGEST_IN_README: usize = 25;

const README_LINES: usize = 200;
const README_BYTES: usize = 11_000;

/// Words that mean something special here. A page that uses one has it in bold once, where it says what the word means.
const PRIVATE: [&str; 19] = [
    "account",
    "acts",
    "alias group",
    "averaged posterior",
    "bare fit",
    "blind spot",
    "box",
    "culprit",
    "discrepancy",
    "evidence",
    "law",
    "outbreak",
    "quoted",
    "round",
    "seated",
    "snapshot",
    "stand-in",
    "walker",
    "weighed",
];

fn root() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let built = option_env!("CARGO_MANIFEST_DIR").map(PathBuf::from);
    here.or(built).unwrap_or_default()
}

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap()
}

/// A line in which a span of code is one word and a link is its text.
fn plain(line: &str) -> String {
    let mut text = String::new();
    for (k, span) in line.split('`').enumerate() {
        text += if k % 2 == 0 { span } else { "CODE" };
    }
    while let Some(open) = text.find("](") {
        let close = text[open..].find(')').map_or(text.len(), |k| open + k + 1);
        text.replace_range(open..close, "]");
    }
    text
}

/// What a line is, apart from the blocks of code.
enum Line<'a> {
    /// Of no paragraph: empty, a heading, a row of a table.
    Between,
    /// The first of a list's item.
    Item(&'a str),
    Text(&'a str),
}

fn read(line: &str) -> Line<'_> {
    let line = line.trim();
    let digits = line.trim_start_matches(|c: char| c.is_ascii_digit());
    let numbered = digits.strip_prefix(". ").filter(|_| digits != line);
    match line.strip_prefix("- ").or(numbered) {
        Some(item) => Line::Item(item),
        None if line.is_empty() || line.starts_with(['#', '|']) => Line::Between,
        None => Line::Text(line),
    }
}

/// The paragraphs and the items of lists, without blocks of code, tables and headings.
fn paragraphs(page: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    // text and blocks of code take turns
    for text in page.split("```").step_by(2) {
        found.push(String::new());
        for line in text.lines() {
            let (is_new, words) = match read(line) {
                Line::Between => (true, ""),
                Line::Item(words) => (true, words),
                Line::Text(words) => (false, words),
            };
            if is_new {
                found.push(String::new());
            }
            if let Some(last) = found.last_mut() {
                *last += &plain(words);
                *last += " ";
            }
        }
    }
    found
}

fn words(sentence: &str) -> usize {
    let is_word = |token: &&str| token.chars().any(char::is_alphanumeric);
    sentence.split_whitespace().filter(is_word).count()
}

/// The sentences of a page. Each ends at a stop, a question mark or an exclamation mark before a space, or with its paragraph.
fn sentences(page: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    for paragraph in paragraphs(page) {
        for token in paragraph.split_whitespace() {
            if let Some(last) = found.last_mut() {
                *last += token;
                *last += " ";
            }
            let bare = token.trim_end_matches(['*', ')', '"', '\'', ']']);
            if bare.ends_with(['.', '!', '?']) && !["al.", "doi."].contains(&bare) {
                found.push(String::new());
            }
        }
        found.push(String::new());
    }
    found.retain(|s| words(s) > 0);
    found
}

#[test]
fn sentences_are_counted_as_a_reader_counts_them() {
    let text = "# A heading of many words. And more.\n\nOne two `a b. c` [three](http://x.y/z. w) 0.5. Four\nfive!\n\
        | a | table. |\n\n- six +- seven\n- **eight.** Nine et al. ten\n\n```sh\nplychain loop. # code\n```\n1. eleven";
    let counts: Vec<usize> = sentences(text).iter().map(|s| words(s)).collect();
    assert_eq!(counts, [5, 2, 2, 1, 4, 1]);
}

#[test]
fn sentences_of_the_pages_are_short() {
    for name in PAGES {
        let page = page(name);
        let sentences = sentences(&page);
        assert!(sentences.len() > 40, "{name}: {}", sentences.len());
        let longest = if name == "README.md" {
            LONGEST_IN_README
        } else {
            LONGEST
        };
        let too_long: Vec<_> = sentences.iter().filter(|s| words(s) > longest).collect();
        assert!(
            too_long.is_empty(),
            "{name}: {} sentences of more than {longest} words: {too_long:#?}",
            too_long.len()
        );
        let total: usize = sentences.iter().map(|s| words(s)).sum();
        let mean = total as f64 / sentences.len() as f64;
        println!("{name}: {} sentences, mean {mean:.1}", sentences.len());
        assert!(mean <= MEAN, "{name}: mean {mean:.1} words");
    }
}

/// What a reader meets elsewhere is short too: no sentence above `LONGEST`, `MEAN` in the mean.
pub fn is_short(what: &str, text: &str) {
    let sentences = sentences(text);
    let too_long: Vec<_> = sentences.iter().filter(|s| words(s) > LONGEST).collect();
    assert!(too_long.is_empty(), "{what}: {too_long:#?}");
    let total: usize = sentences.iter().map(|s| words(s)).sum();
    let mean = total as f64 / sentences.len().max(1) as f64;
    println!("{what}: {} sentences, mean {mean:.1}", sentences.len());
    assert!(mean <= MEAN, "{what}: mean {mean:.1} words");
}

/// Length of a line that was broken: the program fills up to 100 columns, and longer lines stand alone.
const FILLED: std::ops::RangeInclusive<usize> = 79..=100;

/// The paragraphs of what a verb prints to a terminal, without rows of tables: those have two blanks in a row.
pub fn paragraphs_of_terminal(text: &str) -> String {
    let mut paragraphs = String::new();
    let mut before = "";
    for line in text.lines() {
        let words = line.trim();
        // a stage that takes long says so every few seconds, without a full stop
        let is_row = words.contains("  ") || words.ends_with(" s so far");
        let goes_on = FILLED.contains(&before.len()) && !words.starts_with("- ");
        paragraphs += if goes_on { " " } else { "\n\n" };
        paragraphs += if is_row { "" } else { words };
        before = if is_row { "" } else { line };
    }
    paragraphs
}

/// The paragraphs and items of lists of a page, without its figures.
pub fn paragraphs_of_html(page: &str) -> String {
    let mut text = String::new();
    for tag in ["<p", "<li"] {
        for piece in page
            .split(tag)
            .skip(1)
            .filter(|p| p.starts_with(['>', ' ']))
        {
            let inside = piece.split_once('>').map_or("", |(_, inside)| inside);
            let end = inside
                .find("</p>")
                .into_iter()
                .chain(inside.find("</li>"))
                .min();
            let inside = &inside[..end.unwrap_or(0)];
            let mut bare = inside.split('<');
            text += bare.next().unwrap_or_default();
            for rest in bare {
                text += rest.split_once('>').map_or("", |(_, after)| after);
            }
            text += "\n\n";
        }
    }
    text
}

#[test]
fn effects_and_their_tests_are_told_in_short_sentences() {
    let of = |effect: &&dyn plychain::effect::Effect| {
        let entry = effect.entry();
        format!("{}\n\n{}\n\n", entry.about, entry.confirm)
    };
    let text: String = plychain::effect::EFFECTS.iter().map(of).collect();
    is_short("effects", &text);
}

#[test]
fn the_readme_is_read_in_five_minutes() {
    let readme = page("README.md");
    let (lines, bytes) = (readme.lines().count(), readme.len());
    println!("{lines} lines, {bytes} bytes");
    assert!(lines <= README_LINES, "{lines} lines");
    assert!(bytes <= README_BYTES, "{bytes} bytes");
}

#[test]
fn private_words_are_explained_where_they_are_used() {
    let mut unexplained = Vec::new();
    for name in PAGES {
        let text = page(name).to_lowercase();
        let shown: Vec<String> = text
            .split("```")
            .step_by(2)
            .flat_map(str::lines)
            .map(plain)
            .collect();
        let shown = shown.join(" ");
        for word in PRIVATE {
            let is_letter = |c: char| c.is_alphanumeric();
            let is_used = shown.match_indices(word).any(|(k, _)| {
                let after = shown[k + word.len()..].trim_start_matches('s');
                !shown[..k].ends_with(is_letter) && !after.starts_with(is_letter)
            });
            if is_used && !shown.contains(&format!("**{word}**")) {
                unexplained.push(format!("{name}: {word}"));
            }
        }
    }
    assert!(unexplained.is_empty(), "{unexplained:#?}");
}

/// Summaries of commands and of their options, as `--help` has them, each with the place where it stands.
fn help_of(command: &clap::Command, found: &mut Vec<(String, String)>) {
    let name = command.get_name().to_string();
    let about = [command.get_about(), command.get_long_about()];
    found.extend(
        about
            .into_iter()
            .flatten()
            .map(|t| (name.clone(), t.to_string())),
    );
    for option in command.get_arguments() {
        let texts = [option.get_help(), option.get_long_help()];
        let place = format!("{name} {}", option.get_id());
        found.extend(
            texts
                .into_iter()
                .flatten()
                .map(|t| (place.clone(), t.to_string())),
        );
    }
    command.get_subcommands().for_each(|c| help_of(c, found));
}

#[test]
fn help_is_short_and_begins_with_a_verb() {
    let program = <plychain::cli::Cli as clap::CommandFactory>::command();
    let mut help = Vec::new();
    help_of(&program, &mut help);
    assert!(help.len() > 100, "{}", help.len());
    let (mut total, mut count, mut long) = (0, 0, Vec::new());
    for (place, text) in &help {
        for sentence in sentences(text) {
            total += words(&sentence);
            count += 1;
            if words(&sentence) > LONGEST {
                long.push(format!("{place}: {sentence}"));
            }
        }
    }
    println!("{count} sentences, mean {:.1}", total as f64 / count as f64);
    assert!(long.is_empty(), "{long:#?}");
    assert!(total as f64 <= MEAN * count as f64);
    const VERBS: [&str; 18] = [
        "Identify", "Weigh", "Build", "Check", "Write", "Run", "Suggest", "Compute", "Simulate",
        "List", "Print", "Export", "Make", "Compare", "Collect", "Find", "Serve", "Sample",
    ];
    let begins = |c: &clap::Command| {
        let about = c.get_about().map(ToString::to_string).unwrap_or_default();
        let first = about
            .split_whitespace()
            .next()
            .unwrap_or_default()
            .to_string();
        (!VERBS.contains(&first.as_str())).then(|| format!("{}: {about}", c.get_name()))
    };
    let others: Vec<String> = program.get_subcommands().filter_map(begins).collect();
    assert!(others.is_empty(), "{others:#?}");
}

/// What a link to a heading calls it.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    text.chars()
        .filter(kept)
        .collect::<String>()
        .replace(' ', "-")
}

#[test]
fn links_lead_to_files_and_headings() {
    let mut broken = Vec::new();
    for name in PAGES {
        let text = page(name);
        let targets = text.split("](").skip(1);
        let targets = targets.filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|t| !t.starts_with("http")) {
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let folder = root().join(Path::new(name).parent().unwrap());
            let path = match file {
                "" => root().join(name),
                _ => folder.join(file),
            };
            let has_heading = || {
                let page = fs::read_to_string(&path).unwrap();
                page.lines()
                    .any(|line| line.starts_with('#') && anchor(line) == heading)
            };
            if !path.is_file() || !heading.is_empty() && !has_heading() {
                broken.push(format!("{name}: {target}"));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}
