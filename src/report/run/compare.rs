//! Several runs side by side.

use indexmap::IndexSet;

use super::rounds::{NumberOfRound, RESIDUAL};
use crate::report::page::Page;
use crate::report::round::RoundReport;
use crate::section::{Document, Piece, Section, Table, TableCell, row};

/// What of a round's chains is shown.
const CHAINS: [NumberOfRound; 2] = [
    ("R-hat, largest", |r| r.convergence.rhat_max),
    ("ESS bulk, smallest", |r| r.convergence.ess_bulk_min),
];

/// A page that shows the results of each run, and its last round, side by side. Runs go by their names.
pub fn comparison(runs: &[(String, Page)]) -> Document {
    let header = || std::iter::once("").chain(runs.iter().map(|(name, _)| name.as_str()));
    let pages: Vec<&Page> = runs.iter().map(|(_, page)| page).collect();
    let numbers = RESIDUAL.iter().chain(&CHAINS).map(|(what, number)| {
        let number = |p: &&Page| TableCell::three(p.report.last().map(number));
        row(*what, pages.iter().map(number))
    });
    let numbers = Table::new("Last round", header(), numbers);
    let about = Table::new("What was run", header(), about(&pages));
    let mut columns: Vec<&str> = header().collect();
    columns.extend((pages.len() == 2).then_some("difference, sd"));
    let caption = "The result: mean +- sd [95 % interval]";
    let constants = Table::new(caption, columns, results(&pages));
    let constants = Section::new("Constants").with(constants);
    let mut said = Section::new("What was said");
    for (name, page) in runs {
        said.push(Piece::Heading(name.clone()));
        let closing = page.report.closing.as_ref();
        said.extend(closing.map(|c| Piece::Paragraph(c.verdict.text.clone())));
        let warnings = page
            .report
            .last()
            .into_iter()
            .flat_map(|r| r.warnings.clone());
        said.push(Piece::list(warnings));
    }
    Document {
        title: "plychain: runs side by side".into(),
        heading: "Runs side by side".into(),
        lead: Vec::new(),
        sections: vec![
            Section::new("Runs").with(about),
            constants,
            Section::new("Residual and chains").with(numbers),
            said,
        ],
        folded: false,
        footer: "Intervals hold 95 % of the posterior. The same data and model with another seed differ by the Monte Carlo error only.".into(),
    }
}

/// A row for each constant of any run, with the difference of two of them over both their sds.
fn results(pages: &[&Page]) -> Vec<Vec<TableCell>> {
    let constants: IndexSet<&str> = pages.iter().flat_map(|page| page.constants()).collect();
    let cells = |name: &&str| {
        let all: Vec<Option<[f64; 4]>> = pages.iter().map(|p| p.to_quote(name)).collect();
        let difference = match all[..] {
            [Some([a, sd, ..]), Some([b, other, ..])] => {
                Some(TableCell::signed((b - a) / sd.hypot(other), 1))
            }
            _ => None,
        };
        let cells = all
            .into_iter()
            .map(|i| i.map_or(TableCell::Missing, TableCell::interval));
        row(*name, cells.chain(difference))
    };
    constants.iter().map(cells).collect()
}

/// What each run was.
fn about(pages: &[&Page]) -> Vec<Vec<TableCell>> {
    let line = |what: &str, text: &dyn Fn(&Page) -> String| {
        let cell = |page: &&Page| match text(page) {
            empty if empty.is_empty() => TableCell::Missing,
            text => text.into(),
        };
        row(what, pages.iter().map(cell))
    };
    let declared = |r: &RoundReport| r.effects_declared.join(", ");
    vec![
        line("model", &|p| p.report.model.clone()),
        line("effects declared", &|p| {
            p.report.last().map(declared).unwrap_or_default()
        }),
        line("verdict", &|p| {
            let closing = p.report.closing.as_ref();
            closing.map_or(String::new(), |c| c.verdict.words())
        }),
        line("rounds", &|p| p.report.rounds.len().to_string()),
        line("seed", &|p| p.report.seed.to_string()),
        line("version", &|p| p.manifest.version.clone()),
        line("data", &data),
    ]
}

/// The hashes of a run's data, short: equal ones are equal data.
fn data(page: &Page) -> String {
    let files = page.manifest.inputs_sha256.values().skip(1);
    let files: Vec<String> = files.map(|hash| hash.chars().take(8).collect()).collect();
    files.join(" ")
}
