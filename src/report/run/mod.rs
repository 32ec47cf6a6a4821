//! What a run found, as sections for the terminal and for the page.

mod compare;
mod effects;
mod posterior;
mod rounds;
mod surrogate;

pub use compare::comparison;
pub use effects::{averaged, tracing};

use super::document::Closing;
use super::page::Page;
use super::round::RoundReport;
use super::section::{Document, Piece, Section};
use crate::trace::{Conclusion, Status};

/// One identification: the constants, their uncertainty and correlation, and the residual against the noise.
pub fn identification(model: &str, round: &RoundReport) -> Section {
    let c = &round.convergence;
    let mut section = Section::new(format!(
        "{model}: posterior of {} draws",
        c.chains * c.draws
    ))
    .with(posterior::table("", round))
    .with(posterior::correlation(round))
    .with(posterior::closed_amplitudes(round))
    .with(rounds::residual(std::slice::from_ref(round), &["".into()]))
    .say(rounds::points(round))
    .say(&c.text);
    section.extend(surrogate::errors(round));
    section.with(Piece::Warnings(round.warnings.clone()))
}

/// Before and after, round by round, and the verdict.
pub fn closed(page: &Page, closing: &Closing) -> Vec<Section> {
    let mut sections = vec![rounds::before_and_after(page)];
    sections.extend(rounds::steps(page));
    sections.extend(
        closing
            .with_discrepancy
            .as_ref()
            .map(posterior::with_discrepancy),
    );
    if let Some(last) = page.report.last().filter(|r| r.tracing.is_some()) {
        sections.push(effects::blind_spots(
            &closing.blind_spots,
            &page.constants(),
        ));
        let suspect = closing.verdict.suspect.as_ref();
        let quoted = effects::quoted(&closing.averaged_posterior, suspect, &last.alone());
        sections.push(quoted.with_all(effects::remarks(closing)));
    }
    let mut verdict = Section::default().with(verdict(&closing.verdict));
    verdict.extend(confirming(&closing.verdict));
    sections.push(verdict);
    sections
}

/// The page of a run.
pub fn document(page: &Page) -> Document {
    let report = &page.report;
    let manifest = &page.manifest;
    let together = report.together.as_ref();
    let mut sections = vec![rounds::before_and_after(page).with_all(rounds::only_on_page(page))];
    sections.extend(together.map(|t| t.section(&report.both())));
    sections.extend(rounds::steps(page));
    sections.push(Section::new("Mesh").with(Piece::figure("mesh")));
    sections.push(rounds::maps(page));
    sections.push(effects::ranking(page));
    if !report.blind_spots().is_empty() {
        sections.push(effects::blind_spots(
            report.blind_spots(),
            &page.constants(),
        ));
    }
    sections.push(posterior::section(page));
    sections.push(posterior::convergence(page));
    sections.extend(surrogate::section(page));
    sections.push(surrogate::provenance(page));
    let about = format!(
        "plychain {}, seed {}, {} input files",
        manifest.version,
        report.seed,
        manifest.inputs_sha256.len()
    );
    Document {
        title: format!("{}: plychain report", report.model),
        heading: format!("Identification of {}", report.model),
        lead: std::iter::once(Piece::Note(about))
            .chain(lead(page))
            .collect(),
        sections,
        footer:
            "Units stand in the names: GPa, mm, \u{b5}m, nm. Intervals hold 95 % of the posterior."
                .into(),
    }
}

/// The verdict in a sentence, and what should be known before the numbers are used.
fn lead(page: &Page) -> Vec<Piece> {
    let Some(last) = page.report.last() else {
        return Vec::new();
    };
    let sentence = rounds::sentence(page, last);
    let mut pieces = match page.report.closing.as_ref().map(|c| &c.verdict) {
        Some(said) => vec![verdict(said), Piece::Paragraph(sentence)],
        None => vec![Piece::Verdict {
            word: String::new(),
            text: sentence,
            open: !last.warnings.is_empty(),
        }],
    };
    let closing = page.report.closing.iter();
    pieces.extend(closing.flat_map(|c| confirming(&c.verdict)));
    pieces.push(Piece::Warnings(last.warnings.clone()));
    pieces
}

fn verdict(verdict: &Conclusion) -> Piece {
    let open = verdict.status == Status::Unexplained;
    Piece::Verdict {
        word: match open {
            true => "unexplained structure remains".into(),
            false => verdict.status.words().into(),
        },
        text: verdict.text.clone(),
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
