//! What a validation found: `validation.json` and one screen.

use serde_json::{Map, Value, json};

use crate::diagnose::Row;
use crate::posterior::Importance;
use crate::posterior::importance::TOLERANCE;
use crate::report::quoted::under_the_full_model;
use crate::section::{Piece, Section, Table, TableCell, row};
use crate::validate::grid::PosteriorGrid;
use crate::validate::priors::PriorRow;
use crate::validate::quadrature::GridMoments;
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
    pub grid: Option<(&'a PosteriorGrid, f64)>,
    /// Thickness both ways, if it is uncertain.
    pub thickness: Option<&'a Comparison>,
    /// The declared prior and others; empty where they were not looked at.
    pub priors: &'a [PriorRow],
    /// How the draws fare under the finite elements.
    pub importance: &'a Importance,
}

/// Difference of moments from the chain: mean in the chain's sd, sd in %.
fn difference(chain: &[Row], moments: &GridMoments) -> Vec<(f64, f64)> {
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

fn moments_json(chain: &[Row], moments: &GridMoments) -> Value {
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
            "finite_elements": self.importance,
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
        if let Some(c) = self.thickness {
            value["thickness"] = json!({
                "nodes": c.nodes, "samples": c.samples,
                "worst_difference_in_standard_errors": c.worst(), "rms_difference_in_standard_errors": c.rms(),
                "differences_and_standard_errors": c.differences,
                "seconds_a_node": { "monte_carlo": c.seconds[0], "analytic": c.seconds[1] },
            });
        }
        if !self.priors.is_empty() {
            let rows = (self.priors.iter())
                .map(|row| (row.prior.clone(), moments_json(self.chain, &row.moments)));
            value["priors"] = Value::Object(rows.collect());
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
        if let Some((name, [shift, error])) = self.importance.beyond(TOLERANCE) {
            doubts.push(format!(
                "the finite elements have {name} {shift:+.2} +- {error:.2} sd from where the density has it"
            ));
        }
        doubts
    }

    /// One screen.
    pub fn section(&self, title: &str) -> Section {
        let mut section = Section::new(format!("validation of {title}")).with(self.moments());
        section.push(self.accounts());
        section.extend(priors(self.priors));
        let doubts = self.doubts();
        if doubts.is_empty() {
            return section.say("Nothing speaks against this posterior as that of its model.");
        }
        let doubts = doubts.into_iter().map(|doubt| format!("doubt: {doubt}"));
        section.extend(doubts.map(Piece::Heading));
        section
    }

    /// The chain's moments, and how far those of the grid are off.
    fn moments(&self) -> Table {
        let others = [(self.grid.map(|(g, _)| &g.moments), "grid")];
        let others: Vec<(&str, Vec<(f64, f64)>)> = others
            .into_iter()
            .filter_map(|(moments, name)| Some((name, difference(self.chain, moments?))))
            .collect();
        let heads = |(name, _): &(&str, _)| [format!("{name}: mean, sd off"), "sd off, %".into()];
        let header = ["", "chain mean", "sd"].into_iter().map(String::from);
        let header = header.chain(others.iter().flat_map(heads));
        let rows = self.chain.iter().enumerate().map(|(k, r)| {
            let mut cells = row(&r.name, TableCell::as_precise_as(r.sd, [r.mean, r.sd]));
            for (_, off) in &others {
                let off = off.get(k);
                cells.push(TableCell::signed(off.map(|o| o.0), 3));
                cells.push(TableCell::signed(off.map(|o| o.1), 2));
            }
            cells
        });
        Table::new("", header, rows)
    }

    /// What the grid, the thickness by Monte Carlo and the finite elements say.
    fn accounts(&self) -> Piece {
        let mut lines = Vec::new();
        if let Some((grid, seconds)) = self.grid {
            let nodes = grid.nodes.len();
            lines.push(format!(
                "grid: {nodes} nodes, {seconds:.2} s, log evidence {:.2}",
                grid.moments.log_evidence
            ));
            lines.extend(self.thickness.map(|c| {
                let [monte_carlo, analytic] = c.seconds.map(|s| duration(s * nodes as f64));
                format!(
                    "thickness by Monte Carlo ({} samples) at {} nodes: worst {:.2}, rms {:.2} standard errors from the analytic marginal; the whole grid on one thread: {monte_carlo} against {analytic}",
                    c.samples, c.nodes, c.worst(), c.rms()
                )
            }));
        }
        let moved = under_the_full_model(self.importance, "the finite elements", "");
        let share = 100.0 * self.importance.effective;
        let counted =
            |moved| format!("{moved} Of the draws {share:.0} % are effective under them.");
        lines.extend(moved.map(counted));
        Piece::list(lines)
    }
}

/// The constants under other priors, if there are any.
fn priors(priors: &[PriorRow]) -> Option<Piece> {
    let [first, _, ..] = priors else {
        return None;
    };
    let d = first.moments.correlation.len();
    let names = first.moments.names[..d].iter().map(String::as_str);
    let rows = priors.iter().map(|r| {
        let m = &r.moments;
        let cell = |k: usize| TableCell::mean_sd(Some((m.mean[k], m.sd[k])));
        row(&r.prior, (0..d).map(cell))
    });
    let table = Table::new("", std::iter::once("prior").chain(names), rows);
    Some(table.into())
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", 1e3 * s),
        s if s < 120.0 => format!("{s:.1} s"),
        s => format!("{:.1} min", s / 60.0),
    }
}
