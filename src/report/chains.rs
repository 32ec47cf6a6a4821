//! What chains are worth, parameter by parameter.

use indexmap::IndexMap;
use serde_json::{Value, json};

use crate::diagnose::{Row, Verdict};
use crate::section::{Section, Table, TableCell, row};

/// The numbers of every parameter, and the verdict in a line.
pub fn section(verdict: &Verdict) -> Section {
    let header = [
        "parameter",
        "mean",
        "sd",
        "q2.5",
        "median",
        "q97.5",
        "mcse",
        "R-hat",
        "ESS bulk",
        "ESS tail",
        "tau",
    ];
    let rows = verdict.rows.iter().map(|r| {
        let moments = TableCell::as_precise_as(r.sd, [r.mean, r.sd, r.low, r.median, r.high]);
        let worth = [
            TableCell::three(r.mcse_mean),
            TableCell::fixed(r.rhat, 4),
            TableCell::fixed(r.ess_bulk, 0),
            TableCell::fixed(r.ess_tail, 0),
            TableCell::fixed(r.tau, 1),
        ];
        row(&r.name, moments.into_iter().chain(worth))
    });
    let fixed = verdict.rows.iter().filter(|r| r.sd == 0.0);
    let fixed: Vec<&str> = fixed.map(|r| &*r.name).collect();
    let section = Section::default().with(Table::new("", header, rows));
    let section = match fixed.is_empty() {
        true => section,
        false => section.say(format!("the same in all draws: {}", fixed.join(", "))),
    };
    section.say(verdict.line())
}

/// The figures of a parameter, by name.
fn figures(r: &Row) -> [(&'static str, f64); 16] {
    let [low, median, high] = r.mcse_quantiles;
    [
        ("mean", r.mean),
        ("sd", r.sd),
        ("q2.5", r.low),
        ("median", r.median),
        ("q97.5", r.high),
        ("mcse_mean", r.mcse_mean),
        ("mcse_sd", r.mcse_sd),
        ("mcse_q2.5", low),
        ("mcse_median", median),
        ("mcse_q97.5", high),
        ("rhat", r.rhat),
        ("ess_bulk", r.ess_bulk),
        ("ess_tail", r.ess_tail),
        ("tau", r.tau),
        ("tau_change", r.tau_change),
        ("tau_error", r.tau_error),
    ]
}

/// All figures with all digits, `null` where there is none. R-hat is the nested one (Margossian et al. 2024) where an ensemble has several
/// chains: the rank-normalised one across ensembles.
pub fn json(verdict: &Verdict, remarks: &[String]) -> Value {
    let [ensembles, chains, draws] = verdict.shape;
    let parameters = verdict.rows.iter();
    let parameters = parameters.map(|r| (&r.name, IndexMap::from(figures(r))));
    json!({
        "schema": "plychain-diagnosis/1",
        "converged": verdict.converged,
        "reasons": verdict.reasons,
        "remarks": remarks,
        "ensembles": ensembles,
        "chains": chains,
        "draws": draws,
        "parameters": parameters.collect::<IndexMap<_, _>>(),
    })
}

/// All figures with all digits, a row a parameter.
pub fn csv(verdict: &Verdict) -> String {
    let header = verdict.rows.iter().take(1).map(|r| {
        let names = figures(r).map(|(name, _)| name);
        format!("parameter,{}\n", names.join(","))
    });
    let rows = verdict.rows.iter().map(|r| {
        let name = match r.name.contains([',', '"']) {
            true => format!("\"{}\"", r.name.replace('"', "\"\"")),
            false => r.name.clone(),
        };
        let values = figures(r).map(|(_, value)| format!("{value:?}"));
        format!("{name},{}\n", values.join(","))
    });
    header.chain(rows).collect()
}
