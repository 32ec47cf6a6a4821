//! Several runs side by side.

use maud::html;

use super::tables::{Number, RESIDUAL};
use super::{DASH, document, mean_sd, row, short, table, with_sd};
use crate::report::page::Page;
use crate::report::round::RoundReport;

/// What of a round's chains is shown.
const CHAINS: [Number; 2] = [
    ("R-hat, largest", |r| r.convergence.rhat_max),
    ("ESS bulk, smallest", |r| r.convergence.ess_bulk_min),
];

/// A page that shows the last round of each run, and its averaged posterior, side by side. Runs go by their names.
pub fn comparison(runs: &[(String, Page)]) -> String {
    let header = row("", runs.iter().map(|(name, _)| name.clone()));
    let pages: Vec<&Page> = runs.iter().map(|(_, page)| page).collect();
    let mut constants: Vec<&str> = Vec::new();
    for name in pages.iter().flat_map(|page| page.constants()) {
        if !constants.contains(&name) {
            constants.push(name);
        }
    }
    let intervals = |pick: &dyn Fn(&Page, &str) -> Option<[f64; 4]>| -> Vec<Vec<String>> {
        let of = |name: &&str| row(*name, pages.iter().map(|p| interval(pick(p, name))));
        constants.iter().map(of).collect()
    };
    let bare = intervals(&|page, name| {
        let s = page.report.last()?.posterior.get(name)?;
        Some([s.mean, s.sd, s.low, s.high])
    });
    let averaged = intervals(&|page, name| {
        let a = page.report.averaged(name)?;
        Some([a.mean, a.sd, a.low, a.high])
    });
    let numbers = RESIDUAL.iter().chain(&CHAINS).map(|(what, of)| {
        row(
            *what,
            pages.iter().map(|p| short(p.report.last().and_then(of))),
        )
    });
    let said = |what: &str, cell: &dyn Fn(&Page) -> String| {
        let cells = pages.iter().map(|p| cell(p));
        row(
            what,
            cells.map(|text| if text.is_empty() { DASH.into() } else { text }),
        )
    };
    let of_last =
        |p: &Page, of: &dyn Fn(&RoundReport) -> String| p.report.last().map_or(String::new(), of);
    let about = [
        said("model", &|p| p.report.model.clone()),
        said("effects declared", &|p| {
            of_last(p, &|r| r.effects_declared.join(", "))
        }),
        said("verdict", &|p| {
            let closing = p.report.closing.as_ref();
            closing.map_or(String::new(), |c| c.verdict.status.words().into())
        }),
        said("rounds", &|p| p.report.rounds.len().to_string()),
        said("seed", &|p| p.report.seed.to_string()),
        said("version", &|p| p.manifest.version.clone()),
        said("data", &data),
    ];
    let body = html! {
        header { h1 { "Runs side by side" } }
        main {
            section { h2 { "Runs" } (table("What was run", &header, about, false)) }
            section {
                h2 { "Constants" }
                (table("Posterior of the last round: mean \u{b1} sd [95 % interval]", &header, bare, false))
                @if pages.iter().any(|p| p.report.closing.is_some()) {
                    (table("Averaged over effects that may act unseen", &header, averaged, false))
                }
            }
            section { h2 { "Residual and chains" } (table("Last round", &header, numbers, false)) }
            section {
                h2 { "What was said" }
                @for (name, page) in runs {
                    h3 { (name) }
                    @if let Some(closing) = &page.report.closing { p { (closing.verdict.text) } }
                    ul.warnings { @for w in page.report.last().iter().flat_map(|r| &r.warnings) { li { (w) } } }
                }
            }
        }
        footer.soft { "Intervals hold 95 % of the posterior. The same data and model with another seed differ by the Monte Carlo error only." }
    };
    document("plychain: runs side by side", &body)
}

fn interval(entry: Option<[f64; 4]>) -> String {
    let Some([mean, sd, low, high]) = entry else {
        return DASH.into();
    };
    let [low, high] = [low, high].map(|v| with_sd(v, sd));
    format!("{} [{low}, {high}]", mean_sd(Some((mean, sd))))
}

/// The hashes of a run's data, short: equal ones are equal data.
fn data(page: &Page) -> String {
    let files = page.manifest.inputs_sha256.values().skip(1);
    let files: Vec<String> = files.map(|hash| hash.chars().take(8).collect()).collect();
    files.join(" ")
}
