//! What a run says on the terminal: aligned tables with units in their headers.

use std::fmt::Write;
use std::iter::once;

use super::round::{RoundReport, beside_published};
use super::surrogate::SurrogateReport;
use crate::identify::Refinement;
use crate::quantity::significant;

/// Aligned columns: the first to the left, the others to the right.
pub fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let rows: Vec<_> = rows.into_iter().collect();
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
    for row in &rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

/// The constants, their uncertainty and correlation, and the residual against the noise.
pub fn identification(model: &str, round: &RoundReport) -> String {
    let c = &round.convergence;
    let mut text = format!("\n{model}: posterior of {} draws\n\n", c.chains * c.draws);
    let digits = |value: Option<f64>, n: usize| value.map_or("-".into(), |v| format!("{v:.n$}"));
    let rows = round.posterior.iter().map(|(name, r)| {
        let cov = (!name.contains('.')).then(|| 100.0 * r.sd / r.mean.abs());
        let mut row = vec![name.clone()];
        row.extend([r.mean, r.sd].map(|v| significant(v, r.sd)));
        row.push(digits(cov, 2));
        row.extend([r.low, r.high].map(|v| significant(v, r.sd)));
        row.extend([digits(r.rhat, 4), digits(r.ess_bulk, 0)]);
        (row, r.published)
    });
    let header = ["", "mean", "sd", "COV %", "2.5 %", "97.5 %", "R-hat", "ESS"];
    let (header, rows) = beside_published(header, rows);
    text += &table(&header, rows);
    text += "\ncorrelation\n\n";
    let names = &round.correlation.names;
    let header: Vec<&str> = once("").chain(names.iter().map(String::as_str)).collect();
    let rows = names
        .iter()
        .zip(&round.correlation.matrix)
        .map(|(name, row)| {
            let cells = row.iter().map(|c| digits(*c, 3));
            once(name.clone()).chain(cells).collect()
        });
    text += &table(&header, rows);
    let closed = round.effect_amplitudes.iter();
    let closed = closed.filter(|(name, _)| !round.posterior.contains_key(*name));
    let rows = closed.map(|(name, a)| mean_sd(name, a.mean, a.sd));
    let mut rows = rows.peekable();
    if rows.peek().is_some() {
        text += "\n";
        text += &table(&["declared effect", "mean", "sd"], rows);
    }
    text += &residual(round);
    let _ = writeln!(text, "\n{}", c.text);
    text += &surrogate(&round.surrogate);
    if !round.warnings.is_empty() {
        text += "\nBEFORE YOU USE THESE NUMBERS\n";
        for warning in &round.warnings {
            let _ = writeln!(text, "  - {warning}");
        }
    }
    text
}

/// A row of a name, a mean and an sd.
pub fn mean_sd(name: &str, mean: f64, sd: f64) -> Vec<String> {
    vec![name.into(), significant(mean, sd), significant(sd, sd)]
}

/// What the finite elements say of the reduced model, and how refinement went.
fn surrogate(reduced: &SurrogateReport) -> String {
    let mut text = format!(
        "reduced model against {} at {} posterior draws: at most {:.2} % of a posterior sd in any constant, {:.3} nm in the field\n",
        reduced.truth(),
        reduced.truth_draws,
        100.0 * reduced.max_error_in_posterior_sd,
        reduced.field_error_nm.max
    );
    if let Some(error) = &reduced.over_the_box {
        text += &format!(
            "over its whole box: {:.3} nm, {:.3} nm at most\n",
            error.rms, error.max
        );
    }
    if let Some(bound) = reduced.basis_bound_nm {
        text += &format!(
            "the reduced basis that stands for the finite elements there is off by {bound:.1e} nm at most\n"
        );
    }
    if reduced.refinement.len() > 1 {
        let row = |(k, r): (usize, &Refinement)| {
            vec![
                if k == 0 {
                    "first".into()
                } else {
                    format!("refined {k}")
                },
                r.snapshots.to_string(),
                r.modes.to_string(),
                format!("{:.3}", 100.0 * r.max_error_in_posterior_sd),
                format!("{:.4}", r.max_field_error_nm),
                format!("{:.3}", 100.0 * r.draws_outside_doe),
            ]
        };
        let rows = reduced.refinement.iter().enumerate().map(row);
        let header = [
            "reduced model",
            "snapshots",
            "modes",
            "error % of sd",
            "field nm",
            "draws outside %",
        ];
        text += &format!("\n{}", table(&header, rows));
    }
    text
}

fn residual(round: &RoundReport) -> String {
    let r = &round.residual;
    let dropped = round.noise.points_dropped;
    let row = |name: &str, rms: f64, noise: f64| {
        once(name.into())
            .chain([rms, noise, rms / noise].map(|v| format!("{v:.3}")))
            .collect()
    };
    let rows: [Vec<String>; 2] = [
        row("u1 (along the load)", r.rms_nm.u1, r.noise_nm.u1),
        row("u2 (across)", r.rms_nm.u2, r.noise_nm.u2),
    ];
    let table = table(&["", "RMS nm", "noise nm", "ratio"], rows);
    format!(
        "\nresidual against the noise\n\n{table}\n  {} values of {} points count as {:.0} independent ones; points dropped: {} not measured, not correlated or repeated, {} outliers, {} off the plate, {} outside the window\n  reduced chi^2 of the block averages: {:.3}\n",
        2 * r.n,
        r.n,
        r.n_eff,
        dropped.missing + dropped.uncorrelated + dropped.repeated + dropped.unmatched,
        dropped.outliers,
        dropped.outside_plate,
        dropped.outside_window,
        r.chi2_reduced
    )
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
