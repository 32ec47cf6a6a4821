//! What a run found, as sections for the terminal and for the page.

mod brief;
mod compare;
mod effects;
pub mod posterior;
mod provenance;
mod rounds;

pub use brief::brief;
pub use compare::comparison;
pub use effects::{averaged, tracing};
pub use provenance::timings;

use super::document::{Closing, Report};
use super::learned::not_measured;
use super::page::Page;
use super::round::RoundReport;
use super::told::{in_short, told};
use crate::section::{Document, Piece, Section};
use crate::trace::{Conclusion, Status};

/// One identification: the constants, their uncertainty and correlation, and the residual against the noise.
pub fn identification(report: &Report, round: &RoundReport) -> Section {
    let model = &report.model;
    let c = &round.convergence;
    let mut section = Section::new(format!(
        "{model}: posterior of {} draws",
        c.chains * c.draws
    ))
    .with(posterior::table("", round, &report.learned))
    .say(not_measured(&report.learned).unwrap_or_default())
    .with(posterior::correlation(round))
    .with(posterior::closed_amplitudes(round))
    .with(rounds::residual(std::slice::from_ref(round), &["".into()]))
    .say(rounds::points(round))
    .say(&c.text);
    section.extend(posterior::checked(round));
    section.with(Piece::Warnings(round.warnings.clone()))
}

/// Before and after, round by round, and the verdict.
pub fn closed(page: &Page, closing: &Closing) -> Vec<Section> {
    let mut sections = vec![rounds::before_and_after(page)];
    sections.extend(rounds::steps(page));
    if let Some(last) = page.report.last().filter(|r| r.tracing.is_some()) {
        sections.push(effects::blind_spots(
            &closing.blind_spots,
            &page.constants(),
        ));
        sections.push(effects::to_quote(&page.report, closing, last));
    }
    let mut verdict = Section::default().with(verdict(&page.report, &closing.verdict));
    verdict.extend(confirming(&closing.verdict));
    sections.push(verdict);
    sections
}

/// The page of a run: a first screen, and all else below it, folded, in the order in which one asks.
pub fn document(page: &Page) -> Document {
    let report = &page.report;
    let manifest = &page.manifest;
    let mut sections = vec![
        Section::new("The verdict in full").with_all(in_full(page)),
        told(&report.told),
        rounds::maps(page),
        effects::ranking(page),
        rounds::before_and_after(page).with_all(rounds::only_on_page(page)),
    ];
    sections.extend(rounds::steps(page));
    sections.extend(report.together_section());
    if !report.blind_spots().is_empty() {
        sections.push(effects::blind_spots(
            report.blind_spots(),
            &page.constants(),
        ));
    }
    sections.push(posterior::section(page));
    let checked = report.last().and_then(posterior::checked);
    sections.push(posterior::convergence(page).with_all(checked));
    sections.push(Section::new("Mesh").with(Piece::figure("mesh")));
    sections.push(provenance::section(page));
    let about = format!(
        "plychain {}, seed {}, {} input files",
        manifest.version,
        report.seed,
        manifest.inputs_sha256.len()
    );
    let note = report.told["run"]["note"].as_str();
    let about = note.map_or_else(|| about.clone(), |note| format!("{note}. {about}"));
    Document {
        title: format!("{}: plychain report", report.model),
        heading: format!("Identification of {}", report.model),
        lead: std::iter::once(Piece::Note(about))
            .chain(lead(page))
            .collect(),
        sections,
        folded: true,
        footer:
            "Units stand in the names: GPa, mm, \u{b5}m, nm. Intervals hold 95 % of the posterior."
                .into(),
    }
}

/// Warnings on the first screen.
const FIRST: usize = 2;

/// The first screen: verdict, constants, effects and warnings; what went in, and what is left.
fn lead(page: &Page) -> Vec<Piece> {
    let Some(last) = page.report.last() else {
        return Vec::new();
    };
    let mut left = vec![
        Piece::Heading("Constants".into()),
        brief::constants(page).into(),
    ];
    if has_effects(page) {
        left.push(Piece::Heading("Effects found".into()));
        left.push(brief::found(&page.report, last));
    }
    left.push(brief::checks(&page.report, last, FIRST));
    let right = vec![
        Piece::Heading("What you told the program".into()),
        in_short(&page.report.told).into(),
        Piece::Gallery {
            heading: "What is left of the data".into(),
            names: rounds::closer(page),
        },
    ];
    vec![brief::verdict(page, last), Piece::Columns(left, right)]
}

/// Whether anything stands in the list of effects.
fn has_effects(page: &Page) -> bool {
    let verdict = page.report.closing.as_ref().map(|c| &c.verdict);
    verdict.is_some_and(|v| !v.effects.is_empty() || !v.undecided.is_empty())
}

/// The verdict with its reasons, and what should be known before the numbers are used.
fn in_full(page: &Page) -> Vec<Piece> {
    let Some(last) = page.report.last() else {
        return Vec::new();
    };
    let closing = page.report.closing.as_ref();
    let mut pieces: Vec<Piece> = closing
        .map(|c| verdict(&page.report, &c.verdict))
        .into_iter()
        .collect();
    pieces.push(Piece::Paragraph(rounds::sentence(page, last)));
    pieces.extend(closing.into_iter().flat_map(|c| confirming(&c.verdict)));
    pieces.push(brief::checks(&page.report, last, usize::MAX));
    pieces
}

fn verdict(report: &Report, verdict: &Conclusion) -> Piece {
    let not_measured = not_measured(&report.learned).map_or(String::new(), |s| format!(" {s}"));
    let open = verdict.status == Status::Unexplained;
    Piece::Verdict {
        word: verdict.words(),
        text: format!("{}{not_measured}", verdict.text),
        open,
    }
}

/// The test of every member of every group that the verdict names.
fn confirming(verdict: &Conclusion) -> Vec<Piece> {
    let groups = verdict.confirm.iter().flat_map(|group| {
        let tests = group.tests.iter();
        let tests = tests.map(|t| (t.effect.to_string(), t.test.to_string()));
        let question = group.question().replacen('W', "w", 1);
        [Piece::Heading(question), Piece::List(tests.collect())]
    });
    groups.collect()
}
