//! What tracing and the loop say on the terminal.

use std::fmt::Write;

use super::terminal::{significant, table, wrap};
use super::traced::{self, ALIKE, IMPLAUSIBLE, LINEAR, PROBABLE, headline, unit};
use super::widening::{self, Alone};
use crate::quantity::plus_minus;
use crate::trace::{Closed, Confirming, Found, Tracing};

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
            "alone explains %",
            "resembles (cosine)",
        ],
        &rows,
    );
    for g in &tracing.groups {
        let _ = write!(
            text,
            "\n{}: probability {:.3}, evidence lost without it {:.0} nats, held-out blocks are predicted {}",
            g.members.join(" or "),
            g.probability,
            g.log_bayes_factor,
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
            format!("{} {}", plus_minus(*mean, *sd), unit(parameter))
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
        if found.inclusion_probability >= PROBABLE {
            format!("{:.0}", 100.0 * found.explained_fraction)
        } else {
            "-".into()
        },
        found
            .aliases
            .iter()
            .filter(|(_, cosine)| *cosine >= ALIKE)
            .take(3)
            .map(|(name, cosine)| format!("{name} {cosine:.2}"))
            .collect::<Vec<_>>()
            .join(", "),
    ]
}

/// What could hide in the residual, and the constants averaged over it beside those of the model `alone`.
pub fn averaged(tracing: &Tracing, alone: &Alone) -> String {
    let mut text = blind_spots(tracing);
    text += "\nconstants averaged over what may act unseen: the intervals to quote\n\n";
    let rows: Vec<Vec<String>> = tracing
        .averaged
        .iter()
        .map(|a| {
            let bare = alone.iter().find(|(name, _)| *name == a.name);
            vec![
                a.name.clone(),
                significant(a.mean, a.sd),
                significant(a.sd, a.sd),
                significant(a.low, a.sd),
                significant(a.high, a.sd),
                bare.map_or_else(|| "-".into(), |(_, (mean, sd))| plus_minus(*mean, *sd)),
            ]
        })
        .collect();
    text += &table(&["", "mean", "sd", "2.5 %", "97.5 %", "model alone"], &rows);
    if let Some(note) = widening::note(alone, tracing) {
        text += "\n";
        text += &wrap("  ", "  ", &note);
    }
    text
}

fn blind_spots(tracing: &Tracing) -> String {
    let mut text = String::from(
        "\nblind spots: what one plausible amplitude would do to the constants, in %, and whether it would have been seen\n\n",
    );
    let names: Vec<&str> = tracing.averaged.iter().map(|a| a.name.as_str()).collect();
    let mut header = vec!["", "plausible"];
    header.extend(&names);
    header.extend(["detectable from", "seen"]);
    let rows: Vec<Vec<String>> = tracing
        .blind_spots
        .iter()
        .map(|(_, spot)| {
            let mut row = vec![spot.parameter.clone(), format!("{}", Short(spot.plausible))];
            row.extend(spot.shift_percent.iter().map(|(_, s)| traced::shift(*s, 2)));
            row.push(format!("{}", Short(spot.detectable)));
            let seen = spot.detectable < spot.plausible;
            row.push(if seen { "yes" } else { "NO" }.into());
            row
        })
        .collect();
    text += &table(&header, &rows);
    let large = |spot: &crate::trace::BlindSpot| {
        let mut shifts = spot.shift_percent.iter();
        shifts.any(|(_, s)| s.abs() > traced::LINEAR_PERCENT)
    };
    if tracing.blind_spots.iter().any(|(_, spot)| large(spot)) {
        text += "\n";
        text += &wrap("  ", "  ", LINEAR);
    }
    text
}

/// Three significant digits; `never` for what no amplitude reaches.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let x = self.0;
        if x.is_infinite() {
            return write!(f, "never");
        }
        if x == 0.0 || x.is_nan() {
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
        .rounds
        .iter()
        .enumerate()
        .map(|(k, s)| {
            let r = &s.identification.residual;
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
    text += "\n";
    text += &constants(closed);
    if let Some(round) = &closed.with_discrepancy {
        text += "\nthe last model with the unexplained structure as a correlated discrepancy, if nothing acts that it does not declare\n\n";
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
    let last = &closed.rounds[closed.rounds.len() - 1];
    text += &averaged(&last.tracing, &traced::alone(last));
    let verdict = format!(
        "VERDICT: {}. {}",
        headline(closed.conclusion.status),
        closed.conclusion.text
    );
    text += "\n";
    text += &wrap("", "", &verdict);
    text += &confirm(&closed.conclusion.confirm);
    text
}

/// The constants round by round, with what contradicts its prior.
fn constants(closed: &Closed) -> String {
    let last = &closed.rounds[closed.rounds.len() - 1];
    let names = last.model.constants();
    let rows: Vec<Vec<String>> = names
        .iter()
        .map(|name| {
            let cells = closed.rounds.iter().map(|s| {
                let moments = s.identification.moments(name);
                moments.map_or_else(|| "-".to_string(), |(mean, sd)| plus_minus(mean, sd))
            });
            std::iter::once((*name).to_string()).chain(cells).collect()
        })
        .collect();
    let rounds: Vec<String> = (0..closed.rounds.len())
        .map(|k| format!("round {k}"))
        .collect();
    let header: Vec<&str> = std::iter::once("")
        .chain(rounds.iter().map(String::as_str))
        .collect();
    let mut text = table(&header, &rows);
    for (round, step) in rounds.iter().zip(&closed.rounds) {
        let far = names.iter().filter_map(|name| {
            let said = traced::contradiction(traced::from_prior(step, name)?)?;
            Some(format!("{name} {said}"))
        });
        let far: Vec<String> = far.collect();
        if !far.is_empty() {
            text += &wrap("  ", "  ", &format!("{round}: {}", far.join(", ")));
        }
    }
    text
}

/// The test of every member of every group that was named.
fn confirm(groups: &[Confirming]) -> String {
    let mut text = String::new();
    for group in groups {
        let (leader, others) = (group.tests[0].0, group.tests.len() > 1);
        let _ = writeln!(
            text,
            "\nwhat would {}",
            if others {
                format!("tell {leader} from what could stand in for it")
            } else {
                format!("confirm {leader}")
            }
        );
        for (effect, test) in &group.tests {
            text += &wrap("  ", "    ", &format!("{effect}: {test}"));
        }
    }
    text
}
