//! Several runs side by side.

use maud::html;
use serde_json::Value;

use super::tables::{list, moments};
use super::{document, short, table, with_sd};
use crate::report::page::{Page, words};

/// A page that shows the last round of each run, and its averaged posterior, side by side. Runs go by their names.
pub fn comparison(runs: &[(String, Page)]) -> String {
    let mut header = vec![String::new()];
    header.extend(runs.iter().map(|(name, _)| name.clone()));
    let mut constants: Vec<String> = Vec::new();
    for name in runs.iter().flat_map(|(_, page)| page.constants()) {
        if !constants.contains(&name) {
            constants.push(name);
        }
    }
    let last = |page: &Page| page.rounds().last().cloned().unwrap_or_default();
    let of = |pick: &dyn Fn(&Page, &str) -> Value| -> Vec<Vec<String>> {
        constants
            .iter()
            .map(|name| row(name, runs.iter().map(|(_, p)| interval(&pick(p, name)))))
            .collect()
    };
    let bare = of(&|page, name| last(page)["posterior"][name].clone());
    let averaged = of(&|page, name| page.report["averaged_posterior"][name].clone());
    let numbers = [
        ("residual RMS u1, nm", "/residual/rms_nm/u1"),
        ("residual RMS u2, nm", "/residual/rms_nm/u2"),
        ("noise u1, nm", "/residual/noise_nm/u1"),
        ("noise u2, nm", "/residual/noise_nm/u2"),
        ("reduced \u{3c7}\u{b2}", "/residual/chi2_reduced"),
        ("held-out RMS, nm", "/residual/holdout_rms_nm"),
        ("R-hat, largest", "/convergence/rhat_max"),
        ("ESS bulk, smallest", "/convergence/ess_bulk_min"),
    ]
    .map(|(what, key)| {
        let cell = |page: &Page| short(last(page).pointer(key).unwrap_or(&Value::Null));
        row(what, runs.iter().map(|(_, p)| cell(p)))
    });
    let plain = |what: &str, cell: &dyn Fn(&Page) -> String| {
        row(what, runs.iter().map(|(_, p)| or_dash(cell(p))))
    };
    let about = [
        plain("model", &|p| words(&p.report["model"])),
        plain("effects declared", &|p| {
            list(&last(p)["effects_declared"]).join(", ")
        }),
        plain("verdict", &|p| {
            words(&p.report["verdict"]["status"]).replace('_', " ")
        }),
        plain("rounds", &|p| p.rounds().len().to_string()),
        plain("seed", &|p| p.report["seed"].to_string()),
        plain("version", &|p| words(&p.manifest["version"])),
        plain("data", &data),
    ];
    let any_averaged = runs
        .iter()
        .any(|(_, p)| p.report["averaged_posterior"].is_object());
    let body = html! {
        header { h1 { "Runs side by side" } }
        main {
            section { h2 { "Runs" } (table("What was run", &header, &about, false)) }
            section {
                h2 { "Constants" }
                (table("Posterior of the last round: mean \u{b1} sd [95 % interval]", &header, &bare, false))
                @if any_averaged {
                    (table("Averaged over effects that may act unseen", &header, &averaged, false))
                }
            }
            section { h2 { "Residual and chains" } (table("Last round", &header, &numbers, false)) }
            section {
                h2 { "What was said" }
                @for (name, page) in runs {
                    h3 { (name) }
                    @if let Some(text) = page.report["verdict"]["text"].as_str() { p { (text) } }
                    ul.warnings { @for w in list(&last(page)["warnings"]) { li { (w) } } }
                }
            }
        }
        footer.soft { "Intervals hold 95 % of the posterior. The same data and model with another seed differ by the Monte Carlo error only." }
    };
    document("plychain: runs side by side", &body)
}

fn row(name: &str, cells: impl Iterator<Item = String>) -> Vec<String> {
    std::iter::once(name.to_string()).chain(cells).collect()
}

fn or_dash(text: String) -> String {
    if text.is_empty() {
        "\u{2013}".into()
    } else {
        text
    }
}

fn interval(entry: &Value) -> String {
    let Some((mean, sd)) = moments(entry) else {
        return "\u{2013}".into();
    };
    let end = |key: &str| {
        entry[key]
            .as_f64()
            .map_or("\u{2013}".into(), |v| with_sd(v, sd))
    };
    format!(
        "{} \u{b1} {} [{}, {}]",
        with_sd(mean, sd),
        with_sd(sd, sd),
        end("q2.5"),
        end("q97.5")
    )
}

/// The hashes of a run's data, short: equal ones are equal data.
fn data(page: &Page) -> String {
    let inputs = page.manifest["inputs_sha256"].as_object();
    let files: Vec<String> = inputs
        .into_iter()
        .flatten()
        .skip(1)
        .map(|(_, hash)| words(hash).chars().take(8).collect())
        .collect();
    files.join(" ")
}
