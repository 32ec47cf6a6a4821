//! What a validation found: `validation.json` and one screen.

use serde_json::{Map, Value, json};

use crate::diagnose::Row;
use crate::identify::SurrogateError;
use crate::section::{Piece, Section, Table, TableCell, row};
use crate::validate::grid::PosteriorGrid;
use crate::validate::priors::PriorTable;
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
    /// The second opinion.
    pub preview: Option<&'a GridMoments>,
    /// Thickness both ways, if it is uncertain.
    pub thickness: Option<&'a Comparison>,
    /// Other priors.
    pub priors: Option<&'a PriorTable>,
    /// The finite elements at posterior draws.
    pub truth: &'a SurrogateError,
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
                "the density's error moves a constant by {:.1} % of a posterior sd; with the finite elements' likelihood {:.1} of {} draws count",
                100.0 * self.truth.max_sd(), self.truth.effective_draws(), self.truth.draws
            ));
        }
        doubts
    }

    /// One screen.
    pub fn section(&self, title: &str) -> Section {
        let mut section = Section::new(format!("validation of {title}")).with(self.moments());
        section.extend(self.accounts());
        section.extend(self.priors.and_then(priors).into_iter().flatten());
        let doubts = self.doubts();
        if doubts.is_empty() {
            return section.say("Nothing speaks against this posterior as that of its model.");
        }
        let doubts = doubts.into_iter().map(|doubt| format!("doubt: {doubt}"));
        section.extend(doubts.map(Piece::Heading));
        section
    }

    /// The chain's moments, and how far those of the grid and of the preview are off.
    fn moments(&self) -> Table {
        let others = [
            (self.grid.map(|(g, _)| &g.moments), "grid"),
            (self.preview, "Laplace-GH"),
        ];
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
    fn accounts(&self) -> Vec<Piece> {
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
        let t = self.truth;
        lines.push(format!(
            "finite elements at {} draws: error {:.3} % of a posterior sd, {:.1} effective draws by their likelihood",
            t.draws,
            100.0 * t.max_sd(),
            t.effective_draws()
        ));
        let mut pieces = vec![Piece::list(lines)];
        if t.max_sd() > crate::identify::TOLERANCE {
            pieces.push(reweighted(t).into());
        }
        pieces
    }
}

/// The constants under other priors, if there are any.
fn priors(priors: &PriorTable) -> Option<Vec<Piece>> {
    let [first, _, ..] = &priors.rows[..] else {
        return None;
    };
    let d = first.moments.correlation.len();
    let names = first.moments.names[..d].iter().map(String::as_str);
    let rows = priors.rows.iter().map(|r| {
        let m = &r.moments;
        let cell = |k: usize| TableCell::mean_sd(Some((m.mean[k], m.sd[k])));
        row(&r.prior, (0..d).map(cell))
    });
    let table = Table::new("", std::iter::once("prior").chain(names), rows);
    let outside = priors.outside.iter().map(|(name, _, share)| {
        let percent = 100.0 * share;
        format!("{percent:.2} % of the draws lie outside the box of {name}")
    });
    Some(vec![table.into(), Piece::list(outside)])
}

/// What the finite elements' likelihood makes of the draws at which they were solved.
fn reweighted(truth: &SurrogateError) -> Table {
    let rows = truth.moments.iter().map(|m| {
        let ([mean, sd], [by_weight, sd_by_weight]) = (m.plain, m.weighted);
        let cells = TableCell::as_precise_as(sd, [mean, sd, by_weight, sd_by_weight]);
        row(&m.name, cells)
    });
    let caption = format!(
        "the {} draws, plain and weighted by the finite elements' likelihood; {:.1} of them count, so that a weighted mean is known to {:.1} sd",
        truth.draws,
        truth.effective_draws(),
        1.0 / truth.effective_draws().sqrt()
    );
    Table::new(
        caption,
        ["", "mean", "sd", "weighted mean", "weighted sd"],
        rows,
    )
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{:.0} ms", 1e3 * s),
        s if s < 120.0 => format!("{s:.1} s"),
        s => format!("{:.1} min", s / 60.0),
    }
}
