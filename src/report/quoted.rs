//! The sampled posterior to quote, as `report.json` has it: its answers, what trades against what.

use serde::{Deserialize, Serialize};

use super::json::Keyed;
use super::sources::{WidthSource, sources};
use crate::chain::Draws;
use crate::parameter::{Parameter, ParameterKind};
use crate::posterior::Importance;
use crate::posterior::importance::FAR;
use crate::trace::{Closed, Interval, Proposals, ToQuote};

/// What was sampled for the quoted constants; its draws are `averaged/chain.zarr`.
#[derive(Debug, Serialize, Deserialize)]
pub struct QuotedReport {
    /// One answer, or the three that the quoted intervals span.
    pub answers: Vec<QuotedAnswer>,
    /// Amplitudes that go with a constant over the draws, the strongest first.
    pub trades: Vec<Trade>,
    /// What the widths of the intervals come from, the largest first.
    #[serde(default)]
    pub sources: Vec<WidthSource>,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct QuotedAnswer {
    /// `small`, `all` or `none`: how large effects are that are not declared.
    pub name: String,
    pub constants: Keyed<Interval>,
    pub converged: bool,
    /// Whether the chains have converged, in words.
    pub convergence: String,
    /// How independent proposals fared, where the chains are of such.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proposals: Option<Proposals>,
    /// How the draws fare under the full nonlinear model.
    pub full_model: Importance,
}

/// Something that stands in for a constant, or against it.
#[derive(Debug, Serialize, Deserialize)]
pub struct Trade {
    pub constant: String,
    pub with: String,
    pub correlation: f64,
}

/// Correlations that are said, and how many.
const LEAST: f64 = 0.2;
const MOST: usize = 12;

/// What was sampled of a loop, if it was.
pub fn quoted(closed: &Closed) -> Option<QuotedReport> {
    let ToQuote::Sampled(sampled) = &closed.to_quote else {
        return None;
    };
    let answers = sampled.answers.iter().map(|a| QuotedAnswer {
        name: a.name.into(),
        constants: a.intervals(),
        converged: a.verdict.converged,
        convergence: a.verdict.line(),
        proposals: a.proposals,
        full_model: a.importance.clone(),
    });
    let answers: Vec<QuotedAnswer> = answers.collect();
    let constants: Vec<&String> = sampled.answers[0]
        .verdict
        .rows
        .iter()
        .map(|r| &r.name)
        .collect();
    Some(QuotedReport {
        trades: trades(&sampled.draws, &constants),
        sources: sources(&sampled.draws, &constants),
        answers,
    })
}

/// Amplitudes that go with the constants.
fn trades(draws: &Draws, constants: &[&String]) -> Vec<Trade> {
    let is_constant = |name: &String| constants.contains(&name);
    let own =
        |name: &&String| !is_constant(name) && !Parameter::read(name).is(ParameterKind::Choice);
    let all = || draws.names().iter();
    let mut trades: Vec<Trade> = Vec::new();
    for constant in all().filter(|n| is_constant(n)) {
        for with in all().filter(own) {
            let correlation = correlation(draws, constant, with).unwrap_or(0.0);
            if correlation.abs() >= LEAST {
                trades.push(Trade {
                    constant: constant.clone(),
                    with: with.clone(),
                    correlation,
                });
            }
        }
    }
    trades.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    trades.truncate(MOST);
    trades
}

/// Correlation of two variables over all draws; none of one that does not vary.
fn correlation(draws: &Draws, a: &str, b: &str) -> Option<f64> {
    let (a, b) = (draws.index(a)?, draws.index(b)?);
    let n = draws.len() as f64;
    let mean = |k: usize| draws.points().map(|x| x[k]).sum::<f64>() / n;
    let means = [mean(a), mean(b)];
    let mut sums = [0.0; 3];
    for x in draws.points() {
        let d = [x[a] - means[0], x[b] - means[1]];
        sums[0] += d[0] * d[0];
        sums[1] += d[1] * d[1];
        sums[2] += d[0] * d[1];
    }
    Some(sums[2] / (sums[0] * sums[1]).sqrt()).filter(|r| r.is_finite())
}

/// What a full `model` makes of draws, `of_answer` where there are several.
pub(super) fn under_the_full_model(
    of: &Importance,
    model: &str,
    of_answer: &str,
) -> Option<String> {
    let (name, [shift, error]) = of.largest()?;
    let moved = match of.corrected {
        true => " The draws are moved with the means.",
        false => "",
    };
    let mesh = of.mesh_error.map_or_else(String::new, |error| {
        format!(
            " What it adds is a difference on a coarse mesh: the fine mesh changes the log weight of one draw by {error:.1e}."
        )
    });
    Some(format!(
        "Under {model}, the means of {} draws{of_answer} move by {shift:+.3} +- {error:.3} sd at most ({name}). The field moves by {:.3} nm at most.{moved}{mesh}",
        of.draws, of.field_nm
    ))
}

impl QuotedReport {
    /// A warning where the full model has the constants elsewhere.
    pub fn doubt(&self) -> Option<String> {
        let largest = self.answers.iter().filter_map(|a| a.full_model.beyond(FAR));
        let farthest = largest.max_by(|a, b| a.1[0].abs().total_cmp(&b.1[0].abs()));
        farthest.map(|(name, [shift, error])| {
            format!(
                "The full nonlinear model has {name} {shift:+.2} +- {error:.2} sd from where the sampled posterior has it. The intervals lack this difference."
            )
        })
    }

    /// What there is to say beside the intervals.
    pub fn words(&self) -> String {
        let mut said = String::from("Sampled");
        let loose: Vec<&str> = self
            .answers
            .iter()
            .filter(|a| !a.converged)
            .map(|a| a.name.as_str())
            .collect();
        if !loose.is_empty() {
            said += &format!(
                " (not converged, and quoted in closed form: {})",
                loose.join(", ")
            );
        }
        let proposals = self.answers.iter().filter_map(|a| a.proposals);
        let how: Vec<String> = proposals.map(|p| p.words()).collect();
        if !how.is_empty() {
            said += &format!(" ({})", how.join("; "));
        }
        said.push('.');
        for answer in &self.answers {
            let of = match self.answers.len() {
                1 => String::new(),
                _ => format!(" of the answer {}", answer.name),
            };
            let model = "the full nonlinear model";
            let moved = under_the_full_model(&answer.full_model, model, &of);
            said.extend(moved.map(|moved| format!(" {moved}")));
        }
        said
    }

    /// The constants and what trades most against them: the variables of a corner plot, at most so many.
    pub fn leading(&self, most: usize) -> Vec<String> {
        let constants = self.answers.iter().take(1).flat_map(|a| a.constants.keys());
        let mut names: Vec<String> = constants.cloned().collect();
        for trade in &self.trades {
            if names.len() < most && !names.contains(&trade.with) {
                names.push(trade.with.clone());
            }
        }
        names
    }
}
