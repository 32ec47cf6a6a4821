//! `plychain help`: the help of a command, or a section of the manuals that come with the program.

use clap::{Args, CommandFactory};

use super::{Cli, print};
use crate::error::{Error, Result};

/// Arguments of `help`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain help loop              the options of a command
  plychain help models            the manual of model files
  plychain help runs              the manual of run folders and campaigns
  plychain help load series       the sections with these words in their headings")]
pub struct HelpArguments {
    /// A command, `models`, `runs`, or words of a heading in one of the two manuals
    #[arg(value_name = "TOPIC")]
    topic: Vec<String>,
}

/// The manuals by their topics.
const MANUALS: [(&str, &str); 2] = [
    ("models", include_str!("../../models/README.md")),
    ("runs", include_str!("../../runs/README.md")),
];

pub fn run(arguments: &HelpArguments) -> Result<()> {
    let mut program = Cli::command();
    program.build();
    if arguments.topic.is_empty() {
        let text = program.render_long_help().to_string();
        return print(&format!(
            "{text}\nTopics for `plychain help TOPIC`:\n{}",
            topics()
        ));
    }
    if command(&program, &arguments.topic).is_some() {
        let asked = ["plychain"].into_iter();
        let asked = asked.chain(arguments.topic.iter().map(String::as_str));
        let help = Cli::command().try_get_matches_from(asked.chain(["--help"]));
        return print(&help.map_or_else(|help| help.render().to_string(), |_| String::new()));
    }
    let wanted = arguments.topic.join(" ").to_lowercase();
    if let Some((_, manual)) = MANUALS.iter().find(|(topic, _)| *topic == wanted) {
        return print(manual);
    }
    let found: String = MANUALS
        .iter()
        .flat_map(|(_, manual)| sections(manual, &wanted))
        .collect();
    if !found.is_empty() {
        return print(&found);
    }
    let said: Vec<String> = MANUALS
        .iter()
        .flat_map(|(_, m)| mentions(m, &wanted))
        .collect();
    let hint = match said.is_empty() {
        true => "plychain help lists commands and topics".into(),
        false => format!("sections that mention it: {}", said.join("; ")),
    };
    Err(Error::input("TOPIC", "a command, or words of a heading")
        .found(&wanted)
        .hint(hint))
}

/// The command that some words lead to, one below the other.
fn command(program: &clap::Command, words: &[String]) -> Option<clap::Command> {
    let mut command = program;
    for word in words {
        command = command.find_subcommand(word)?;
    }
    Some(command.clone())
}

/// Headings of a manual with their levels and where they begin, without what stands in blocks of code.
fn headings(manual: &str) -> Vec<(usize, &str, usize)> {
    let mut found = Vec::new();
    let (mut at, mut code) = (0, false);
    for line in manual.split_inclusive('\n') {
        code ^= line.starts_with("```");
        let level = line.chars().take_while(|c| *c == '#').count();
        if level > 0 && !code {
            found.push((level, line[level..].trim(), at));
        }
        at += line.len();
    }
    found
}

/// Sections whose headings have some words, with the sections inside.
fn sections<'m>(manual: &'m str, wanted: &str) -> Vec<&'m str> {
    let all = headings(manual);
    let mut end = 0;
    let mut found = Vec::new();
    for (k, (level, title, begin)) in all.iter().enumerate() {
        let title = title.to_lowercase();
        // what is inside a section that was taken is there already
        if *level == 1 || *begin < end || !wanted.split(' ').all(|word| title.contains(word)) {
            continue;
        }
        let next = all[k + 1..].iter().find(|(other, ..)| other <= level);
        end = next.map_or(manual.len(), |(.., at)| *at);
        found.push(&manual[*begin..end]);
    }
    found
}

/// Headings of sections in whose text some words stand.
fn mentions(manual: &str, wanted: &str) -> Vec<String> {
    let all = headings(manual);
    let ends = all.iter().skip(1).map(|(.., at)| *at).chain([manual.len()]);
    let with = all.iter().zip(ends).filter(|((level, _, begin), end)| {
        *level > 1 && manual[*begin..*end].to_lowercase().contains(wanted)
    });
    with.map(|((_, title, _), _)| (*title).to_string())
        .collect()
}

/// The manuals and their sections, one line each.
fn topics() -> String {
    let of = |(topic, manual): &(&str, &str)| {
        let all = headings(manual)
            .into_iter()
            .filter(|(level, ..)| *level == 2);
        let titles: Vec<&str> = all.map(|(_, title, _)| title).collect();
        format!("  {topic}: {}\n", titles.join("; "))
    };
    MANUALS.iter().map(of).collect()
}
