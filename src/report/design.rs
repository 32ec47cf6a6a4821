//! What could be measured next: `design.json` and the terminal.

use std::fmt::Write;

use serde::Serialize;

use super::json::Keyed;
use super::terminal::table;
use crate::infer::Marginal;
use crate::quantity::three_digits;
use crate::trace::{Hidden, Information};
use crate::validate::design::{Assessed, disagreement, log_volume, posterior_sds};

/// The schema of `design.json`.
pub const SCHEMA: &str = "plychain-design/1";

/// `design.json`. Sds are posterior sds, in percent of the prior mean.
#[derive(Debug, Serialize)]
pub struct DesignReport {
    pub schema: &'static str,
    pub model: String,
    /// Constants by which experiments are ranked.
    pub ranked_by: Vec<String>,
    pub prior_sd_percent: Keyed<f64>,
    /// What the model declares.
    pub declared: Vec<TestReport>,
    /// What could be measured beside it, the most telling first.
    pub candidates: Vec<TestReport>,
    /// Effects in the declared field, undeclared and at their plausible sizes.
    pub hidden: Vec<HiddenReport>,
}

#[derive(Debug, Serialize)]
pub struct TestReport {
    pub name: String,
    /// Where nothing acts that is not declared.
    pub sd_percent: Keyed<f64>,
    /// Where every effect of the dictionary may act at its plausible size; of frequencies the same.
    pub sd_percent_with_effects: Keyed<f64>,
    /// Together with all that the model declares, effects acting.
    pub together_percent: Keyed<f64>,
}

#[derive(Debug, Serialize)]
pub struct HiddenReport {
    pub parameter: String,
    pub plausible: f64,
    /// What it does to the constants, percent.
    pub bias_percent: Keyed<f64>,
    /// The amplitude that the residual would show; none where it never does.
    pub detectable: Option<f64>,
    /// By how many sds the field then disagrees with frequencies, by experiment.
    pub disagreement_sd: Keyed<f64>,
}

/// Candidates that are printed, and plates beside which hidden effects are.
const SHOWN: usize = 12;
const PLATES: usize = 3;

/// Names and priors of the constants, and which of them matter.
pub struct Constants<'a> {
    pub priors: &'a [(String, Marginal)],
    pub wanted: &'a [usize],
}

impl Constants<'_> {
    fn percent(&self, k: usize) -> f64 {
        let prior = &self.priors[k].1;
        100.0 * prior.sd / prior.mean.abs()
    }

    fn sds(&self, of: &[&Information], with_effects: bool) -> Keyed<f64> {
        let matrices: Vec<_> = of
            .iter()
            .map(|i| {
                if with_effects {
                    &i.with_effects
                } else {
                    &i.alone
                }
            })
            .collect();
        let sds = posterior_sds(&matrices);
        let each = self.priors.iter().enumerate();
        each.map(|(k, (name, _))| (name.clone(), sds[k] * self.percent(k)))
            .collect()
    }

    fn bias(&self, hidden: &Hidden) -> Keyed<f64> {
        let each = self.priors.iter().enumerate();
        each.map(|(k, (name, _))| (name.clone(), hidden.shift[k] * self.percent(k)))
            .collect()
    }
}

impl DesignReport {
    /// Of what a model declares and of candidates beside it.
    pub fn new(
        model: &str,
        constants: &Constants<'_>,
        declared: &[Assessed],
        mut candidates: Vec<Assessed>,
    ) -> Self {
        let own: Vec<&Information> = declared.iter().map(|d| &d.information).collect();
        let with = |other: &Assessed| -> Vec<Information> {
            let both = own.iter().copied().chain([&other.information]);
            both.cloned().collect()
        };
        let volume = |other: &Assessed| {
            let both = with(other);
            let matrices: Vec<_> = both.iter().map(|i| &i.with_effects).collect();
            log_volume(&matrices, constants.wanted)
        };
        candidates.sort_by(|a, b| volume(a).total_cmp(&volume(b)));
        let test = |a: &Assessed, together: &[&Information]| TestReport {
            name: a.name.clone(),
            sd_percent: constants.sds(&[&a.information], false),
            sd_percent_with_effects: constants.sds(&[&a.information], true),
            together_percent: constants.sds(together, true),
        };
        let beside: Vec<&Assessed> = declared
            .iter()
            .filter(|d| !d.is_field)
            .chain(candidates.iter().filter(|c| !c.is_field).take(PLATES))
            .collect();
        let field = declared.iter().find(|d| d.is_field);
        let hidden = field.iter().flat_map(|field| {
            field.information.hidden.iter().map(|hidden| {
                let apart = beside.iter().map(|other| {
                    let sds =
                        disagreement(hidden, &field.information.alone, &other.information.alone);
                    (other.name.clone(), sds)
                });
                HiddenReport {
                    parameter: hidden.parameter.clone(),
                    plausible: hidden.plausible,
                    bias_percent: constants.bias(hidden),
                    detectable: super::json::finite(hidden.detectable),
                    disagreement_sd: apart.collect(),
                }
            })
        });
        let prior = constants.priors.iter().enumerate();
        Self {
            schema: SCHEMA,
            model: model.into(),
            ranked_by: constants
                .wanted
                .iter()
                .map(|&k| constants.priors[k].0.clone())
                .collect(),
            prior_sd_percent: prior
                .map(|(k, (name, _))| (name.clone(), constants.percent(k)))
                .collect(),
            hidden: hidden.collect(),
            declared: declared.iter().map(|d| test(d, &own)).collect(),
            candidates: candidates
                .iter()
                .map(|c| {
                    let both = with(c);
                    test(c, &both.iter().collect::<Vec<_>>())
                })
                .collect(),
        }
    }

    /// For the terminal.
    pub fn text(&self) -> String {
        let names: Vec<&str> = self.prior_sd_percent.keys().map(String::as_str).collect();
        let percent =
            |sds: &Keyed<f64>| sds.values().map(|v| format!("{v:.2}")).collect::<Vec<_>>();
        let mut header = vec!["posterior sd, %"];
        header.extend(&names);
        let mut rows = vec![row("(prior)", percent(&self.prior_sd_percent))];
        for test in &self.declared {
            rows.push(row(&test.name, percent(&test.sd_percent)));
            // no effect of the dictionary is known to frequencies
            if test.sd_percent_with_effects != test.sd_percent {
                rows.push(row(
                    &format!("{}, any effect acting", test.name),
                    percent(&test.sd_percent_with_effects),
                ));
            }
        }
        if let ([_, _, ..], Some(first)) = (&self.declared[..], self.declared.first()) {
            rows.push(row(
                "all of these together",
                percent(&first.together_percent),
            ));
        }
        let mut text = format!("\n{}: what is declared\n\n", self.model);
        text += &table(&header, rows);
        text += &self.candidates_text(&names);
        text += &self.hidden_text();
        text
    }

    fn candidates_text(&self, names: &[&str]) -> String {
        let cells = |test: &TestReport| {
            let alone = test.sd_percent_with_effects.values();
            let all = alone.chain(test.together_percent.values());
            row(&test.name, all.map(|v| format!("{v:.2}")).collect())
        };
        let mut header = vec!["posterior sd, %, any effect acting".to_string()];
        header.extend(names.iter().map(|n| (*n).to_string()));
        header.extend(names.iter().map(|n| format!("+ {n}")));
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let shown = self.candidates.iter().take(SHOWN);
        format!(
            "\nwhat to measure next: {} of {} candidates, best for {} beside what is declared; \"+\": together with it\n\n{}",
            self.candidates.len().min(SHOWN),
            self.candidates.len(),
            self.ranked_by.join(", "),
            table(&header, shown.map(cells))
        )
    }

    /// Effects that move a constant by more than its sd and that the field does not show, or hardly.
    fn hidden_text(&self) -> String {
        let Some(field) = self.declared.first() else {
            return String::new();
        };
        let moves = |h: &&HiddenReport| {
            let mut each = h.bias_percent.iter();
            each.any(|(name, b)| {
                b.abs() > field.sd_percent.get(name).copied().unwrap_or(f64::INFINITY)
            })
        };
        let hidden: Vec<&HiddenReport> = self.hidden.iter().filter(moves).collect();
        let Some(first) = hidden.first() else {
            return String::new();
        };
        let mut header = vec![
            "effect that nobody declares".to_string(),
            "plausible".into(),
            "field shows from".into(),
        ];
        header.extend(first.bias_percent.keys().map(|n| format!("{n} %")));
        header.extend((1..=first.disagreement_sd.len()).map(|k| format!("({k})")));
        let rows = hidden.iter().map(|h| {
            let shows = h.detectable.map_or("never".into(), three_digits);
            let numbers = h.bias_percent.values().map(|b| format!("{b:+.1}"));
            let apart = h.disagreement_sd.values().map(|d| format!("{d:.1}"));
            std::iter::once(h.parameter.clone())
                .chain([three_digits(h.plausible), shows])
                .chain(numbers)
                .chain(apart)
                .collect()
        });
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let mut text = format!(
            "\nwhat a plausible effect does to the constants by the field alone, and by how many sds frequencies would contradict it\n\n{}",
            table(&header, rows)
        );
        for (k, name) in first.disagreement_sd.keys().enumerate() {
            let _ = writeln!(text, "  ({}) {name}", k + 1);
        }
        text
    }
}

fn row(name: &str, cells: Vec<String>) -> Vec<String> {
    std::iter::once(name.to_string()).chain(cells).collect()
}
