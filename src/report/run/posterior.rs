//! The posterior: its summary, correlation, chains.

use super::effects;
use super::rounds::names;
use crate::parameter::Parameter;
use crate::report::json::Keyed;
use crate::report::learned::{self, Learned};
use crate::report::page::Page;
use crate::report::quoted::under_the_full_model;
use crate::report::round::{MeanAndSd, RoundReport};
use crate::section::{Piece, Section, Table, TableCell, row};

/// What is printed of one parameter.
pub struct MarginalRow<'a> {
    pub name: &'a str,
    pub found: MeanAndSd,
    /// 2.5 %, 50 % and 97.5 %.
    pub quantiles: [f64; 3],
    pub rhat: f64,
    pub ess_bulk: f64,
    pub learned: Option<Learned>,
    pub published: Option<MeanAndSd>,
}

/// Marginal posteriors.
pub fn marginals<'a>(caption: &str, rows: impl Iterator<Item = MarginalRow<'a>>) -> Table {
    let [prior, data] = learned::HEADERS;
    let header = [
        "",
        "mean",
        "sd",
        "COV %",
        "2.5 %",
        "median",
        "97.5 %",
        "R-hat",
        "ESS",
        prior,
        data,
        "published",
    ];
    let rows = rows.map(|r| {
        let MeanAndSd { mean, sd } = r.found;
        let cov = (!Parameter::read(r.name).is_amplitude()).then(|| 100.0 * sd / mean.abs());
        let [low, median, high] = r.quantiles;
        let [mean, sd, low, median, high] =
            TableCell::as_precise_as(sd, [mean, sd, low, median, high]);
        let [prior, data] = Learned::cells(r.learned.as_ref());
        let cells = [
            mean,
            sd,
            TableCell::fixed(cov, 2),
            low,
            median,
            high,
            TableCell::fixed(r.rhat, 4),
            TableCell::fixed(r.ess_bulk, 0),
            prior,
            data,
            TableCell::published(r.published),
        ];
        row(r.name, cells)
    });
    Table::new(caption, header, rows)
}

/// The marginal posteriors of a round.
pub fn table(caption: &str, round: &RoundReport, learned: &Keyed<Learned>) -> Table {
    let rows = round.posterior.iter().map(|(name, r)| {
        let found = MeanAndSd::from((r.mean, r.sd));
        MarginalRow {
            name,
            found,
            quantiles: [r.low, r.median, r.high],
            rhat: r.rhat,
            ess_bulk: r.ess_bulk,
            learned: learned.get(name).map(|l| l.of(found)),
            published: r.published,
        }
    });
    marginals(caption, rows)
}

pub fn correlation(round: &RoundReport) -> Table {
    let names = &round.correlation.names;
    let rows = names.iter().zip(&round.correlation.matrix);
    let rows = rows.map(|(name, r)| row(name, r.iter().map(|v| TableCell::fixed(*v, 3))));
    let header = std::iter::once("").chain(names.iter().map(String::as_str));
    Table::new("correlation of the draws", header, rows)
}

/// Amplitudes of declared effects that are not sampled.
pub fn closed_amplitudes(round: &RoundReport) -> Table {
    let closed = round.effect_amplitudes.iter();
    let closed = closed.filter(|(name, _)| !round.posterior.contains_key(*name));
    let rows = closed.map(|(name, a)| row(name, TableCell::as_precise_as(a.sd, [a.mean, a.sd])));
    Table::new("", ["declared effect", "mean", "sd"], rows)
}

/// How the draws of a round fare under the full model.
pub fn checked(round: &RoundReport) -> Option<Piece> {
    let said = under_the_full_model(&round.full_model, "the full nonlinear model", "");
    said.map(Piece::Paragraph)
}

/// Constants: prior, rounds, averaged; summary; correlation; corner plots.
pub fn section(page: &Page) -> Section {
    let rounds = &page.report.rounds;
    let names = names(page);
    let mut section = Section::new("Posterior").with(Piece::figure("intervals"));
    for (round, name) in rounds.iter().zip(&names) {
        section.push(table(
            &format!("Posterior: {name}"),
            round,
            &page.report.learned,
        ));
    }
    if let (Some(closing), Some(last)) = (&page.report.closing, rounds.last()) {
        let quoted = effects::to_quote(&page.report, closing, last);
        section.push(Piece::Heading(quoted.title));
        section.extend(quoted.pieces);
        section.push(Piece::Figure {
            heading: "Joint posterior to quote, with the amplitudes that trade most against the constants".into(),
            name: "corner-averaged".into(),
        });
    }
    section.extend(rounds.last().map(|r| correlation(r).into()));
    let last = rounds.len().saturating_sub(1);
    for k in [0, last].into_iter().take(1 + usize::from(last > 0)) {
        section.push(Piece::Figure {
            heading: names
                .get(k)
                .map_or_else(String::new, |n| format!("Joint posterior: {n}")),
            name: format!("corner-{k}"),
        });
    }
    section.with(Piece::Note("Dashed: prior. Red: truth, where it is known. Black: bounds at which a prior is cut. Shades hold 39, 86 and 99 % of the draws.".into()))
}

/// Whether the draws can be used.
pub fn convergence(page: &Page) -> Section {
    let header = ["", "R-hat", "ESS bulk", "ESS tail", "MCSE of the mean"];
    let mut section = Section::new("Convergence");
    for (round, name) in page.report.rounds.iter().zip(names(page)) {
        let rows = round.posterior.iter().map(|(name, s)| {
            let [bulk, tail] = [s.ess_bulk, s.ess_tail].map(|v| TableCell::fixed(v, 0));
            let cells = [
                TableCell::fixed(s.rhat, 4),
                bulk,
                tail,
                TableCell::three(s.mcse_mean),
            ];
            row(name, cells)
        });
        let c = &round.convergence;
        section = section
            .with(Table::new(format!("Chains of {name}"), header, rows).sortable())
            .with(Piece::Note(format!(
                "{}. Not stored: {}. Ended because {}.",
                c.text, c.burn_in, c.stopped
            )));
    }
    let last = page.report.rounds.len().saturating_sub(1);
    let figures = ["trace", "rank"];
    section.with_all(figures.map(|what| Piece::figure(format!("{what}-{last}"))))
}
