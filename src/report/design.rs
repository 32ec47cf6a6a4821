//! What could be measured next: `design.json` and the terminal.

use std::iter::once;

use nalgebra::DMatrix;
use serde::Serialize;

use super::json::Keyed;
use crate::infer::Marginal;
use crate::section::{Digits, Piece, Section, Table, TableCell, row};
use crate::trace::Information;
use crate::validate::design::{Assessed, disagreement, log_volume, posterior_sds};

/// The schema of `design.json`.
pub const SCHEMA: &str = "plychain-design/1";

/// `design.json`. Sds are posterior sds, in percent of the prior mean.
#[derive(Debug, Serialize)]
pub struct DesignReport {
    pub schema: &'static str,
    pub model: String,
    /// How fields would be measured, and what says so.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub assumed: String,
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
    /// 1 - sd^2 / prior sd^2 of the test alone, effects acting: 0 where it adds nothing to the prior.
    pub from_data: Keyed<f64>,
}

#[derive(Debug, Serialize)]
pub struct HiddenReport {
    pub parameter: String,
    pub plausible: f64,
    /// What it does to the constants, percent.
    pub bias_percent: Keyed<f64>,
    /// The amplitude that the residual would show; none where it never does.
    pub detectable: f64,
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

    /// A number of each constant.
    fn keyed(&self, of: impl Fn(usize) -> f64) -> Keyed<f64> {
        let each = self.priors.iter().enumerate();
        each.map(|(k, (name, _))| (name.clone(), of(k))).collect()
    }

    fn sds(&self, of: &[&Information], precision: fn(&Information) -> &DMatrix<f64>) -> Keyed<f64> {
        let matrices: Vec<_> = of.iter().map(|i| precision(i)).collect();
        let sds = posterior_sds(&matrices);
        self.keyed(|k| sds[k] * self.percent(k))
    }

    /// Share of the prior's variance that sds, percent, leave no more.
    fn learned(&self, sds: &Keyed<f64>) -> Keyed<f64> {
        self.keyed(|k| 1.0 - (sds[k] / self.percent(k)).powi(2))
    }
}

/// What all declared experiments and another one say.
fn with<'a>(own: &[&'a Information], other: &'a Assessed) -> Vec<&'a Information> {
    own.iter().copied().chain([&other.information]).collect()
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
        let volume = |other: &Assessed| {
            let both = with(&own, other);
            let matrices: Vec<_> = both.iter().map(|i| &i.with_effects).collect();
            log_volume(&matrices, constants.wanted)
        };
        candidates.sort_by(|a, b| volume(a).total_cmp(&volume(b)));
        let test = |a: &Assessed, together: &[&Information]| {
            let with_effects = constants.sds(&[&a.information], |i| &i.with_effects);
            TestReport {
                name: a.name.clone(),
                sd_percent: constants.sds(&[&a.information], |i| &i.alone),
                from_data: constants.learned(&with_effects),
                sd_percent_with_effects: with_effects,
                together_percent: constants.sds(together, |i| &i.with_effects),
            }
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
                    bias_percent: constants.keyed(|k| hidden.shift[k] * constants.percent(k)),
                    detectable: hidden.detectable,
                    disagreement_sd: apart.collect(),
                }
            })
        });
        Self {
            schema: SCHEMA,
            model: model.into(),
            assumed: String::new(),
            ranked_by: constants
                .wanted
                .iter()
                .map(|&k| constants.priors[k].0.clone())
                .collect(),
            prior_sd_percent: constants.keyed(|k| constants.percent(k)),
            hidden: hidden.collect(),
            declared: declared.iter().map(|d| test(d, &own)).collect(),
            candidates: candidates.iter().map(|c| test(c, &with(&own, c))).collect(),
        }
    }

    /// What is declared, what to measure next, and what could act unseen.
    pub fn sections(&self) -> Vec<Section> {
        let names: Vec<&str> = self.prior_sd_percent.keys().map(String::as_str).collect();
        let declared =
            Section::new(format!("{}: what is declared", self.model)).say(self.assumed.clone());
        let mut sections = vec![
            declared.with(self.declared_table(&names)),
            self.candidates_section(&names),
        ];
        sections.extend(self.hidden_section());
        sections
    }

    fn declared_table(&self, names: &[&str]) -> Table {
        let mut rows = vec![row("(prior)", percent(&self.prior_sd_percent))];
        for test in &self.declared {
            rows.push(row(&test.name, percent(&test.sd_percent)));
            // no effect of the dictionary is known to frequencies
            if test.sd_percent_with_effects != test.sd_percent {
                let name = format!("{}, any effect acting", test.name);
                rows.push(row(name, percent(&test.sd_percent_with_effects)));
            }
        }
        if let [test] = &self.declared[..] {
            let shares = test.from_data.values();
            let shares = shares.map(|s| TableCell::with_unit(100.0 * s, Digits::Fixed(0), "%"));
            rows.push(row("from the data, any effect acting", shares));
        }
        if let [first, _, ..] = &self.declared[..] {
            let together = percent(&first.together_percent);
            rows.push(row("all of these together", together));
        }
        let header = once("posterior sd, %").chain(names.iter().copied());
        Table::new("", header, rows)
    }

    fn candidates_section(&self, names: &[&str]) -> Section {
        let shown = self.candidates.iter().take(SHOWN);
        let rows = shown.map(|test| {
            let alone = percent(&test.sd_percent_with_effects);
            row(&test.name, alone.chain(percent(&test.together_percent)))
        });
        let header = once("posterior sd, %, any effect acting".to_string())
            .chain(names.iter().map(|n| (*n).to_string()))
            .chain(names.iter().map(|n| format!("+ {n}")));
        let section = Section::new(format!(
            "what to measure next: {} of {} candidates, best for {} beside what is declared; \"+\": together with it",
            self.candidates.len().min(SHOWN),
            self.candidates.len(),
            self.ranked_by.join(", ")
        ));
        section
            .say(self.advice().unwrap_or_default())
            .with(Table::new("", header, rows))
    }

    /// What the best candidate does to the constant that it helps most.
    fn advice(&self) -> Option<String> {
        let best = self.candidates.first()?;
        let before = &self.declared.first()?.together_percent;
        let gain =
            |name: &str| before.get(name).copied().unwrap_or(0.0) / best.together_percent[name];
        let names = self.ranked_by.iter();
        let name = names.max_by(|a, b| gain(a).total_cmp(&gain(b)))?;
        let [from, to] =
            [before, &best.together_percent].map(|of| Digits::Fixed(1).write(of[name]));
        Some(format!(
            "Measured beside what is declared, \"{}\" takes {name} from {from} to {to} %.",
            best.name
        ))
    }

    /// Effects that move a constant by more than its sd and that the field does not show, or hardly.
    fn hidden_section(&self) -> Option<Section> {
        let field = self.declared.first()?;
        let moves = |h: &&HiddenReport| {
            let mut each = h.bias_percent.iter();
            each.any(|(name, b)| {
                b.abs() > field.sd_percent.get(name).copied().unwrap_or(f64::INFINITY)
            })
        };
        let hidden: Vec<&HiddenReport> = self.hidden.iter().filter(moves).collect();
        let first = hidden.first()?;
        let header = [
            "effect that nobody declares",
            "plausible",
            "field shows from",
        ];
        let header = header.into_iter().map(String::from);
        let header = header
            .chain(first.bias_percent.keys().map(|n| format!("{n} %")))
            .chain((1..=first.disagreement_sd.len()).map(|k| format!("({k})")));
        let rows = hidden.iter().map(|h| {
            let sizes = [
                TableCell::three(h.plausible),
                TableCell::or_never(h.detectable),
            ];
            let biases = h.bias_percent.values().map(|b| TableCell::signed(*b, 1));
            let apart = h.disagreement_sd.values().map(|d| TableCell::fixed(*d, 1));
            row(&h.parameter, sizes.into_iter().chain(biases).chain(apart))
        });
        let tests = first.disagreement_sd.keys().enumerate();
        let tests = tests.map(|(k, name)| format!("({}) {name}", k + 1));
        let section = Section::new(
            "what a plausible effect does to the constants by the field alone, and by how many sds frequencies would contradict it",
        );
        Some(
            section
                .with(Table::new("", header, rows))
                .with(Piece::list(tests)),
        )
    }
}

fn percent(sds: &Keyed<f64>) -> impl Iterator<Item = TableCell> {
    sds.values().map(|v| TableCell::fixed(*v, 2))
}
