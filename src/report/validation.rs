//! What a validation found: `validation.json` and one screen.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::terminal::{mean_sd, table};
use crate::diagnose::Row;
use crate::identify::SurrogateError;
use crate::quantity::{plus_minus, significant};
use crate::validate::grid::Grid;
use crate::validate::priors::Table;
use crate::validate::quadrature::Moments;
use crate::validate::thickness::Comparison;

/// The schema of `validation.json`.
pub const SCHEMA: &str = "plychain-validation/1";

/// Agreement of grid and chain that is asked for: mean in sd, sd in %.
pub const AGREEMENT: (f64, f64) = (0.05, 3.0);

/// Agreement of Monte Carlo and analytic thickness, in Monte Carlo standard errors: root mean square over the nodes, and
/// largest. On the default model the largest of 200 lies between 2.4 and 4.4 from seed to seed, while the root mean square
/// stays within 4 % of 1.
pub const MOST_ERRORS: [f64; 2] = [1.25, 6.0];

/// Everything about one posterior.
pub struct Validation<'a> {
    /// The chain's figures.
    pub chain: &'a [Row],
    /// The grid, unless there are too many parameters for one, and the seconds it took.
    pub grid: Option<(&'a Grid, f64)>,
    /// The second opinion.
    pub preview: Option<&'a Moments>,
    /// Thickness both ways, if it is uncertain.
    pub thickness: Option<&'a Comparison>,
    /// Other priors.
    pub priors: Option<&'a Table>,
    /// The finite elements at posterior draws.
    pub truth: &'a SurrogateError,
    /// How often the run had refined the reduced model that is validated.
    pub refinements: usize,
}

/// Difference of moments from the chain: mean in the chain's sd, sd in %.
fn difference(chain: &[Row], moments: &Moments) -> Vec<(f64, f64)> {
    chain
        .iter()
        .zip(moments.mean.iter().zip(&moments.sd))
        .map(|(row, (mean, sd))| ((mean - row.mean) / row.sd, 100.0 * (sd / row.sd - 1.0)))
        .collect()
}

fn largest(differences: &[(f64, f64)]) -> (f64, f64) {
    differences.iter().fold((0.0, 0.0), |a, d| {
        (f64::max(a.0, d.0.abs()), f64::max(a.1, d.1.abs()))
    })
}

fn moments_json(chain: &[Row], moments: &Moments) -> Value {
    let differences = difference(chain, moments);
    let rows = moments.names.iter().enumerate().map(|(k, name)| {
        let (mean, sd) = (moments.mean[k], moments.sd[k]);
        let row = json!({
            "mean": mean, "sd": sd, "cov_percent": 100.0 * sd / mean.abs(),
            "mean_minus_chain_in_sd": differences.get(k).map(|d| d.0),
            "sd_against_chain_percent": differences.get(k).map(|d| d.1),
        });
        (name.clone(), row)
    });
    json!({
        "parameters": rows.collect::<Map<_, _>>(),
        "correlation": moments.correlation,
        "log_evidence": moments.log_evidence,
    })
}

impl Validation<'_> {
    /// `validation.json`.
    pub fn numbers(&self) -> Value {
        let mut value = json!({
            "schema": SCHEMA,
            "trusted": self.doubts().is_empty(),
            "doubts": self.doubts(),
            "chain": self.chain.iter().map(|r| (r.name.clone(), json!({ "mean": r.mean, "sd": r.sd }))).collect::<Map<_, _>>(),
            "finite_elements": {
                "draws": self.truth.draws,
                "max_error_in_posterior_sd": self.truth.max_sd(),
                "error_in_posterior_sd": self.truth.shift_sd.iter().map(|(n, s)| (n.clone(), json!(s))).collect::<Map<_, _>>(),
                "effective_draws": self.truth.effective_draws(),
                "log_importance_weights": self.truth.log_weights,
                "moments_at_draws": self.truth.moments.iter().map(|m| (m.name.clone(), json!({
                    "mean": m.plain[0], "sd": m.plain[1], "weighted_mean": m.weighted[0], "weighted_sd": m.weighted[1],
                }))).collect::<Map<_, _>>(),
            },
            "refinements": self.refinements,
        });
        if let Some((grid, seconds)) = self.grid {
            let mut numbers = moments_json(self.chain, &grid.moments);
            numbers["nodes"] = json!(grid.nodes.len());
            numbers["seconds"] = json!(seconds);
            numbers["bounds"] = json!(grid.bounds);
            numbers["warnings"] = json!(grid.warnings);
            numbers["marginals"] = json!(grid.marginals);
            value["grid"] = numbers;
        }
        if let Some(preview) = self.preview {
            value["laplace_gauss_hermite"] = moments_json(self.chain, preview);
        }
        if let Some(c) = self.thickness {
            value["thickness"] = json!({
                "nodes": c.nodes, "samples": c.samples,
                "worst_difference_in_standard_errors": c.worst(), "rms_difference_in_standard_errors": c.rms(),
                "differences_and_standard_errors": c.differences,
                "seconds_a_node": { "monte_carlo": c.seconds[0], "analytic": c.seconds[1] },
            });
        }
        if let Some(table) = self.priors {
            let rows = table
                .rows
                .iter()
                .map(|row| (row.prior.clone(), moments_json(self.chain, &row.moments)));
            value["priors"] = Value::Object(rows.collect());
            if let Some((name, bounds, share)) = &table.outside {
                value["outside_the_box"] =
                    json!({ "box": name, "bounds": bounds, "share_of_draws": share });
            }
        }
        value
    }

    /// What speaks against the posterior, in sentences; none if it can be trusted as the posterior of its model.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        if let Some((grid, _)) = self.grid {
            let (mean, sd) = largest(&difference(self.chain, &grid.moments));
            if mean > AGREEMENT.0 || sd > AGREEMENT.1 {
                doubts.push(format!(
                    "grid and chain differ by {mean:.3} sd in a mean and {sd:.1} % in an sd"
                ));
            }
            doubts.extend(grid.warnings.iter().cloned());
        }
        if let Some(c) = self.thickness
            && (c.rms() > MOST_ERRORS[0] || c.worst() > MOST_ERRORS[1])
        {
            doubts.push(format!(
                "Monte Carlo and analytic thickness differ by {:.2} standard errors (RMS), {:.1} at a node",
                c.rms(),
                c.worst()
            ));
        }
        if self.truth.max_sd() > crate::identify::TOLERANCE {
            doubts.push(format!(
                "the reduced model's error moves a constant by {:.1} % of a posterior sd; with the finite elements' likelihood {:.1} of {} draws count",
                100.0 * self.truth.max_sd(), self.truth.effective_draws(), self.truth.draws
            ));
        }
        doubts
    }

    /// One screen.
    pub fn text(&self, title: &str) -> String {
        let mut text = format!("\nvalidation of {title}\n\n");
        let mut header = vec!["", "chain mean", "sd"];
        let all: Vec<(&str, Vec<(f64, f64)>)> = [
            ("grid", self.grid.map(|(g, _)| &g.moments)),
            ("preview", self.preview),
        ]
        .into_iter()
        .filter_map(|(name, m)| m.map(|m| (name, difference(self.chain, m))))
        .collect();
        for (name, _) in &all {
            header.extend(match *name {
                "grid" => ["grid: mean, sd off", "sd off, %"],
                _ => ["Laplace-GH: mean, sd off", "sd off, %"],
            });
        }
        let rows = self.chain.iter().enumerate().map(|(k, row)| {
            let mut cells = mean_sd(&row.name, row.mean, row.sd);
            for (_, d) in &all {
                let (mean, sd) = d.get(k).copied().unwrap_or((f64::NAN, f64::NAN));
                cells.extend([format!("{mean:+.3}"), format!("{sd:+.2}")]);
            }
            cells
        });
        text += &table(&header, rows);
        self.lines(&mut text);
        let doubts = self.doubts();
        if doubts.is_empty() {
            text += "\nNothing speaks against this posterior as that of its model.\n";
        }
        for doubt in doubts {
            let _ = writeln!(text, "\ndoubt: {doubt}");
        }
        text
    }

    fn lines(&self, text: &mut String) {
        text.push('\n');
        if let Some((grid, seconds)) = self.grid {
            let _ = writeln!(
                text,
                "  grid: {} nodes, {seconds:.2} s, log evidence {:.2}",
                grid.nodes.len(),
                grid.moments.log_evidence
            );
            if let Some(c) = self.thickness {
                let whole = c.seconds.map(|s| s * grid.nodes.len() as f64);
                let _ = writeln!(
                    text,
                    "  thickness by Monte Carlo ({} samples) at {} nodes: worst {:.2}, rms {:.2} standard errors from the analytic marginal;\n    the whole grid on one thread: {} against {}",
                    c.samples,
                    c.nodes,
                    c.worst(),
                    c.rms(),
                    duration(whole[0]),
                    duration(whole[1])
                );
            }
        }
        let t = self.truth;
        let _ = writeln!(
            text,
            "  finite elements at {} draws: error {:.3} % of a posterior sd, {:.1} effective draws by their likelihood",
            t.draws,
            100.0 * t.max_sd(),
            t.effective_draws()
        );
        if self.refinements > 0 {
            let _ = writeln!(
                text,
                "  reduced model: as the run had it after {} refinement(s)",
                self.refinements
            );
        }
        if t.max_sd() > crate::identify::TOLERANCE {
            *text += &reweighted(t);
        }
        let Some(priors) = self.priors.filter(|p| p.rows.len() > 1) else {
            return;
        };
        text.push('\n');
        let d = priors.rows[0].moments.correlation.len();
        let mut header = vec!["prior"];
        header.extend(priors.rows[0].moments.names[..d].iter().map(String::as_str));
        let rows = priors.rows.iter().map(|row| {
            let m = &row.moments;
            let cell = |k: usize| plus_minus(m.mean[k], m.sd[k]);
            std::iter::once(row.prior.clone())
                .chain((0..d).map(cell))
                .collect()
        });
        *text += &table(&header, rows);
        if let Some((name, _, share)) = &priors.outside {
            let _ = writeln!(
                text,
                "  {:.2} % of the draws lie outside the box of {name}",
                100.0 * share
            );
        }
    }
}

/// What the finite elements' likelihood makes of the draws at which they were solved.
fn reweighted(truth: &SurrogateError) -> String {
    let rows = truth.moments.iter().map(|m| {
        let ([mean, sd], [by_weight, sd_by_weight]) = (m.plain, m.weighted);
        let mut cells = mean_sd(&m.name, mean, sd);
        cells.extend([by_weight, sd_by_weight].map(|v| significant(v, sd)));
        cells
    });
    let header = ["", "mean", "sd", "weighted mean", "weighted sd"];
    format!(
        "\n  the {} draws, plain and weighted by the finite elements' likelihood; {:.1} of them count, so that a weighted mean is known to {:.1} sd\n\n{}",
        truth.draws,
        truth.effective_draws(),
        1.0 / truth.effective_draws().sqrt(),
        table(&header, rows)
    )
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", 1e3 * s),
        s if s < 120.0 => format!("{s:.1} s"),
        s => format!("{:.1} min", s / 60.0),
    }
}
