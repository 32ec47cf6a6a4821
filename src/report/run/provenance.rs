//! How a run can be made again.

use crate::progress::StageCost;
use crate::report::page::Page;
use crate::section::{Digits, Piece, Section, Table, TableCell, row};

/// What the stages of a run cost.
pub fn timings(stages: &[StageCost]) -> Table {
    let line = |cost: &StageCost| {
        let seconds = [Some(cost.wall_s), cost.processor_s].map(|s| TableCell::fixed(s, 2));
        let times = TableCell::count(cost.times);
        row(&*cost.stage, std::iter::once(times).chain(seconds))
    };
    let header = ["stage", "times", "wall_s", "processor_s"];
    Table::new("What each stage cost", header, stages.iter().map(line))
}

/// How the run can be made again.
pub fn section(page: &Page) -> Section {
    let manifest = &page.manifest;
    let about = [
        (
            "command",
            format!("plychain {}", manifest.command.join(" ")),
        ),
        ("version", manifest.version.clone()),
        ("seed", page.report.seed.to_string()),
        ("seconds", Digits::Three.write(manifest.seconds)),
    ];
    let about = about
        .map(|(name, text)| (name.to_string(), text))
        .into_iter();
    let hashes = manifest.inputs_sha256.iter();
    let hashes = hashes.map(|(path, hash)| (format!("SHA-256 of {path}"), hash.clone()));
    Section::new("Provenance")
        .with(Piece::List(about.chain(hashes).collect()))
        .with(timings(&manifest.stages))
        .with(Piece::Note("Draws: chain.zarr; of a loop those to quote in averaged/. Numbers: report.json. Figures with their numbers as JSON: figures/.".into()))
}
