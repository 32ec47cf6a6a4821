//! What a run says on the terminal: aligned tables with units in their headers.

use std::fmt::Write;

use super::numbers::correlation;
use crate::identify::Identification;
use crate::infer::Model;
pub use crate::quantity::significant;

/// Aligned columns: the first to the left, the others to the right.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |k: usize| {
        rows.iter()
            .map(|r| r[k].chars().count())
            .chain([header[k].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut text = String::new();
        for (k, cell) in cells.enumerate() {
            let pad = " ".repeat(widths[k] - cell.chars().count());
            if k == 0 {
                text += &format!("  {cell}{pad}");
            } else {
                text += &format!("  {pad}{cell}");
            }
        }
        text.trim_end().to_string() + "\n"
    };
    let mut text = line(&mut header.iter().copied());
    for row in rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

/// The constants, their uncertainty and correlation, and the residual against the noise.
pub fn identification(model: &Model, round: &Identification) -> String {
    let mut text = format!(
        "\n{}: posterior of {} draws\n\n",
        model.file.name,
        round.draws.len()
    );
    let rows: Vec<Vec<String>> = round
        .verdict
        .rows
        .iter()
        .map(|r| {
            let cov = if r.name.contains('.') {
                "-".into()
            } else {
                format!("{:.2}", 100.0 * r.sd / r.mean.abs())
            };
            vec![
                r.name.clone(),
                significant(r.mean, r.sd),
                significant(r.sd, r.sd),
                cov,
                significant(r.low, r.sd),
                significant(r.high, r.sd),
                format!("{:.4}", r.rhat),
                format!("{:.0}", r.ess_bulk),
            ]
        })
        .collect();
    text += &table(
        &["", "mean", "sd", "COV %", "2.5 %", "97.5 %", "R-hat", "ESS"],
        &rows,
    );
    text += "\ncorrelation\n\n";
    let names: Vec<&str> = round.verdict.rows.iter().map(|r| r.name.as_str()).collect();
    let header: Vec<&str> = std::iter::once("").chain(names.iter().copied()).collect();
    let rows: Vec<Vec<String>> = correlation(round)
        .iter()
        .zip(&names)
        .map(|(row, name)| {
            std::iter::once((*name).to_string())
                .chain(row.iter().map(|c| format!("{c:.3}")))
                .collect()
        })
        .collect();
    text += &table(&header, &rows);
    if !round.effect_amplitudes.is_empty() {
        let rows: Vec<Vec<String>> = round
            .effect_amplitudes
            .iter()
            .map(|(name, mean, sd)| {
                vec![name.clone(), significant(*mean, *sd), significant(*sd, *sd)]
            })
            .collect();
        text += "\n";
        text += &table(&["declared effect", "mean", "sd"], &rows);
    }
    text += &residual(round);
    let _ = writeln!(text, "\n{}", round.verdict.line());
    text += &surrogate(round);
    if !round.warnings.is_empty() {
        text += "\nBEFORE YOU USE THESE NUMBERS\n";
        for warning in &round.warnings {
            let _ = writeln!(text, "  - {warning}");
        }
    }
    text
}

/// What the finite elements say of the reduced model, and how refinement went.
fn surrogate(round: &Identification) -> String {
    let error = &round.surrogate;
    let mut text = format!(
        "reduced model against the finite elements at {} posterior draws: at most {:.2} % of a posterior sd in any constant, {:.3} nm in the field\n",
        error.draws,
        100.0 * error.max_sd(),
        error.max_field_nm
    );
    if round.refinements.len() > 1 {
        let rows: Vec<Vec<String>> = round
            .refinements
            .iter()
            .enumerate()
            .map(|(k, r)| {
                vec![
                    if k == 0 {
                        "first".into()
                    } else {
                        format!("refined {k}")
                    },
                    r.snapshots.to_string(),
                    r.modes.to_string(),
                    format!("{:.3}", 100.0 * r.max_error_sd),
                    format!("{:.4}", r.max_field_nm),
                    format!("{:.3}", 100.0 * r.outside_doe),
                ]
            })
            .collect();
        let header = [
            "reduced model",
            "snapshots",
            "modes",
            "error % of sd",
            "field nm",
            "draws outside %",
        ];
        text += &format!("\n{}", table(&header, &rows));
    }
    text
}

fn residual(round: &Identification) -> String {
    let r = &round.residual;
    let rejected = round.inverse.prepared.observation.field.rejected;
    let mut text = String::from("\nresidual against the noise\n\n");
    let rows: Vec<Vec<String>> = [0, 1]
        .map(|c| {
            vec![
                ["u1 (along the load)", "u2 (across)"][c].into(),
                format!("{:.3}", r.rms_nm[c]),
                format!("{:.3}", r.noise_nm[c]),
                format!("{:.3}", r.rms_nm[c] / r.noise_nm[c]),
            ]
        })
        .to_vec();
    text += &table(&["", "RMS nm", "noise nm", "ratio"], &rows);
    let _ = writeln!(
        text,
        "\n  {} values of {} points count as {:.0} independent ones; points dropped: {} not measured, {} outliers, {} off the plate, {} outside the window",
        2 * r.points,
        r.points,
        r.effective_points,
        rejected.missing,
        rejected.outliers,
        rejected.outside_plate,
        rejected.outside_window
    );
    let _ = writeln!(
        text,
        "  reduced chi^2 of the block averages: {:.3}",
        r.chi2_reduced
    );
    text
}

/// Width of running text.
const COLUMNS: usize = 100;

/// Break a text into lines of at most a hundred characters, the first after `first`, the others after `next`.
pub fn wrap(first: &str, next: &str, text: &str) -> String {
    let mut wrapped = String::new();
    let mut line = first.to_string();
    let mut empty = true;
    for word in text.split_whitespace() {
        if !empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            wrapped += &(line + "\n");
            line = next.to_string();
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line += word;
        empty = false;
    }
    wrapped + &line + "\n"
}
