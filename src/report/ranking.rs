//! What tracing and the loop say on the terminal.

use std::fmt::Write;

use super::terminal::{significant, table};
use super::traced::{IMPLAUSIBLE, headline, unit};
use crate::trace::{Closed, Found, Step, Tracing};

/// Effects listed below the accepted ones.
const LISTED: usize = 8;

/// The ranking of effects, what stands in for what, the averaged posterior and the blind spots.
pub fn tracing(tracing: &Tracing) -> String {
    let mut text = String::from("\neffects that the residual was traced to\n\n");
    let rows: Vec<Vec<String>> = tracing.candidates.iter().take(LISTED).map(row).collect();
    text += &table(
        &[
            "effect",
            "probability",
            "log Bayes factor",
            "amplitude",
            "explains %",
            "like it",
        ],
        &rows,
    );
    for g in &tracing.groups {
        let _ = write!(
            text,
            "\n{}: probability {:.3}, evidence lost without it {:.0} nats, held-out blocks are predicted {}",
            g.members.join(" or "),
            g.probability,
            g.drop_nats,
            if g.predicts {
                "better with it"
            } else {
                "no better with it"
            }
        );
        for [a, b] in &g.pairs {
            let _ = write!(text, "; {a} with {b} could stand in for it");
        }
    }
    let _ = writeln!(
        text,
        "\nprobability of smooth structure that no effect explains: {:.3}",
        tracing.discrepancy
    );
    text
}

fn row(found: &Found) -> Vec<String> {
    let amplitude: Vec<String> = found
        .amplitude
        .iter()
        .map(|(name, mean, sd)| {
            let parameter = name.rsplit('.').next().unwrap_or(name);
            format!(
                "{} +- {} {}",
                significant(*mean, *sd),
                significant(*sd, *sd),
                unit(parameter)
            )
        })
        .collect();
    let flag = if found.multiple > IMPLAUSIBLE {
        " (implausibly large)"
    } else {
        ""
    };
    vec![
        found.effect.name().into(),
        format!("{:.3}", found.inclusion_probability),
        format!("{:.1}", found.log_bayes_factor),
        amplitude.join(", ") + flag,
        format!("{:.0}", 100.0 * found.explained_fraction),
        found
            .aliases
            .iter()
            .take(3)
            .map(|(name, cosine)| format!("{name} {cosine:.2}"))
            .collect::<Vec<_>>()
            .join(", "),
    ]
}

/// The constants averaged over what may act unseen, and what could hide in the residual.
pub fn averaged(tracing: &Tracing, bare: Option<&Step>) -> String {
    let mut text = String::from("\nconstants averaged over what may act unseen\n\n");
    let rows: Vec<Vec<String>> = tracing
        .averaged
        .iter()
        .map(|a| {
            let before = bare
                .and_then(|s| s.round.verdict.rows.iter().find(|r| r.name == a.name))
                .map_or_else(
                    || "-".into(),
                    |r| {
                        format!(
                            "{} +- {}",
                            significant(r.mean, r.sd),
                            significant(r.sd, r.sd)
                        )
                    },
                );
            vec![
                a.name.clone(),
                significant(a.mean, a.sd),
                significant(a.sd, a.sd),
                significant(a.low, a.sd),
                significant(a.high, a.sd),
                before,
            ]
        })
        .collect();
    text += &table(
        &["", "mean", "sd", "2.5 %", "97.5 %", "model as given"],
        &rows,
    );
    text += "\nblind spots: what one plausible amplitude would do to the constants, in %, and whether it would have been seen\n\n";
    let names: Vec<&str> = tracing.averaged.iter().map(|a| a.name.as_str()).collect();
    let mut header = vec!["", "plausible"];
    header.extend(&names);
    header.extend(["detectable", "seen"]);
    let rows: Vec<Vec<String>> = tracing
        .blind_spots
        .iter()
        .map(|(_, spot)| {
            let mut row = vec![spot.parameter.clone(), format!("{}", Short(spot.plausible))];
            row.extend(spot.shift_percent.iter().map(|(_, s)| format!("{s:+.2}")));
            row.push(format!("{}", Short(spot.detectable)));
            row.push(
                if spot.detectable < spot.plausible {
                    "yes"
                } else {
                    "NO"
                }
                .into(),
            );
            row
        })
        .collect();
    text += &table(&header, &rows);
    text
}

/// Three significant digits.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let x = self.0;
        if x == 0.0 || !x.is_finite() {
            return write!(f, "{x}");
        }
        let digits = 2 - x.abs().log10().floor() as i32;
        if (0..=6).contains(&digits) {
            write!(f, "{x:.*}", digits as usize)
        } else {
            write!(f, "{x:.2e}")
        }
    }
}

/// Before and after, round by round, and the verdict.
pub fn closed(closed: &Closed) -> String {
    let mut text = String::from("\nbefore and after\n\n");
    let rows: Vec<Vec<String>> = closed
        .steps
        .iter()
        .enumerate()
        .map(|(k, s)| {
            let r = &s.round.residual;
            vec![
                format!("round {k}"),
                s.model
                    .effects
                    .iter()
                    .map(|e| e.name())
                    .collect::<Vec<_>>()
                    .join(", "),
                format!("{:.2}", r.rms_nm[0]),
                format!("{:.2}", r.rms_nm[1]),
                format!("{:.2}", r.noise_nm[0]),
                format!("{:.2}", r.noise_nm[1]),
                format!("{:.3}", r.chi2_reduced),
                format!("{:.2}", s.tracing.holdout_rms_nm),
            ]
        })
        .collect();
    text += &table(
        &[
            "",
            "effects declared",
            "u1 nm",
            "u2 nm",
            "noise u1",
            "noise u2",
            "chi2/dof",
            "held-out nm",
        ],
        &rows,
    );
    let last = &closed.steps[closed.steps.len() - 1];
    let constants = last.tracing.averaged.iter().map(|a| &a.name);
    let rows: Vec<Vec<String>> = constants
        .map(|name| {
            let cells = closed.steps.iter().map(|s| {
                s.round
                    .verdict
                    .rows
                    .iter()
                    .find(|r| r.name == *name)
                    .map_or_else(
                        || "-".to_string(),
                        |r| {
                            format!(
                                "{} +- {}",
                                significant(r.mean, r.sd),
                                significant(r.sd, r.sd)
                            )
                        },
                    )
            });
            std::iter::once(name.clone()).chain(cells).collect()
        })
        .collect();
    let rounds: Vec<String> = (0..closed.steps.len())
        .map(|k| format!("round {k}"))
        .collect();
    let header: Vec<&str> = std::iter::once("")
        .chain(rounds.iter().map(String::as_str))
        .collect();
    text += "\n";
    text += &table(&header, &rows);
    if let Some(round) = &closed.honest {
        text += "\nthe last model with the unexplained structure as a correlated discrepancy\n\n";
        let rows: Vec<Vec<String>> = round
            .verdict
            .rows
            .iter()
            .map(|r| {
                vec![
                    r.name.clone(),
                    significant(r.mean, r.sd),
                    significant(r.sd, r.sd),
                ]
            })
            .collect();
        text += &table(&["", "mean", "sd"], &rows);
    }
    text += &averaged(&last.tracing, closed.steps.first());
    let _ = writeln!(
        text,
        "\nVERDICT: {}. {}",
        headline(closed.conclusion.status),
        closed.conclusion.text
    );
    text
}
