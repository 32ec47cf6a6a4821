//! A field and the frequencies of plates of the same material beside each other: in `report.json`, on the terminal, on the page.

use serde::{Deserialize, Serialize};

use super::json::{Keyed, finite};
use super::plate::PlateReport;
use super::round::MeanAndSd;
use super::section::{Piece, Section, Table, TableCell, row};
use crate::identify::Beside;
use crate::infer::{Moments, Tension};

/// What two kinds of experiments say alone, and how far they disagree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TogetherReport {
    /// The constants by the field alone, with the effects that its model declares.
    pub field_alone: Keyed<MeanAndSd>,
    pub frequencies_alone: Keyed<MeanAndSd>,
    /// The disagreement of these two.
    pub tension: Option<TensionReport>,
    /// The same with the effects that a loop found in the field, and a little of all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension_after: Option<TensionReport>,
    /// Peaks and modes of every experiment of frequencies.
    pub experiments: Vec<PlateReport>,
    /// What should be known of the frequencies before the numbers are used.
    pub warnings: Vec<String>,
}

/// How far two posteriors of one material disagree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TensionReport {
    /// Difference of the posterior means, field less frequencies, and its sd if both saw one material.
    pub difference: Keyed<MeanAndSd>,
    pub chi2: f64,
    /// Directions in the space of the constants of which either says something.
    pub directions: usize,
    /// Probability of as much by chance.
    pub p: f64,
    /// For one material against one for each experiment.
    pub log_bayes_factor: Option<f64>,
}

/// Probability of a disagreement by chance below which it is called one.
const APART: f64 = 0.01;

impl TensionReport {
    pub fn new(tension: &Tension, names: &[&str]) -> Self {
        let difference = names.iter().zip(&tension.difference);
        let of = |(name, [mean, sd]): (&&str, &[f64; 2])| {
            let moments = MeanAndSd {
                mean: *mean,
                sd: *sd,
            };
            ((*name).to_string(), moments)
        };
        Self {
            difference: difference.map(of).collect(),
            chi2: tension.chi2,
            directions: tension.directions,
            p: tension.p,
            log_bayes_factor: finite(tension.log_bayes_factor),
        }
    }

    fn words(&self) -> String {
        let bayes = self.log_bayes_factor.map_or(String::new(), |b| {
            format!("; log Bayes factor {b:+.1} for one material")
        });
        let verdict = if self.p < APART {
            "they contradict each other"
        } else {
            "they agree"
        };
        let p = if self.p < 0.01 {
            format!("{:.0e}", self.p)
        } else {
            format!("{:.2}", self.p)
        };
        format!(
            "{verdict}: chi2 {:.1} in {} directions, p = {p}{bayes}",
            self.chi2, self.directions
        )
    }
}

impl TogetherReport {
    pub fn new(beside: &Beside, after: Option<&Tension>) -> Self {
        let names = beside.model.material().constants();
        let keyed = |m: &Moments| {
            let of = |(k, name): (usize, &&str)| {
                let sd = m.covariance[(k, k)].sqrt();
                let moments = MeanAndSd {
                    mean: m.mean[k],
                    sd,
                };
                ((*name).to_string(), moments)
            };
            names.iter().enumerate().map(of).collect()
        };
        let tension = |t: &Tension| TensionReport::new(t, names);
        Self {
            field_alone: keyed(&beside.field),
            frequencies_alone: keyed(&beside.frequencies),
            tension: beside.tension.as_ref().map(tension),
            tension_after: after.map(tension),
            experiments: beside.found.plates.iter().map(PlateReport::new).collect(),
            warnings: beside.found.warnings.clone(),
        }
    }

    /// Whether the models as they were given contradict each other.
    pub fn contradicts(&self) -> bool {
        self.tension.as_ref().is_some_and(|t| t.p < APART)
    }

    /// What the disagreement means, in sentences.
    fn words(&self) -> Vec<String> {
        let mut said = Vec::new();
        if let Some(tension) = &self.tension {
            said.push(format!(
                "Field and frequencies, each with the model as it was given: {}.",
                tension.words()
            ));
        }
        if let Some(after) = &self.tension_after {
            said.push(format!(
                "With what the loop found in the field: {}.",
                after.words()
            ));
        } else if self.contradicts() {
            said.push("One of the two models lacks something: `plychain loop` seeks it in the field. Do not use constants that average over the contradiction.".into());
        }
        said
    }

    /// What each kind says alone and what both say; `both` has the constants by both experiments.
    fn table(&self, both: &Keyed<MeanAndSd>) -> Table {
        let moments = |m: Option<&MeanAndSd>| TableCell::mean_sd(m.map(|m| (m.mean, m.sd)));
        let difference = |name: &str| self.tension.as_ref()?.difference.get(name);
        let rows = self.field_alone.iter().map(|(name, field)| {
            let apart = difference(name).map(|m| m.mean / m.sd);
            let cells = [
                moments(Some(field)),
                moments(self.frequencies_alone.get(name)),
                TableCell::signed(apart, 1),
                moments(both.get(name)),
            ];
            row(name, cells)
        });
        let header = ["", "field alone", "frequencies alone", "apart, sd", "both"];
        Table::new("", header, rows)
    }

    /// The constants by both, the disagreement, and the peaks.
    pub fn section(&self, both: &Keyed<MeanAndSd>) -> Section {
        let mut section = Section::new("Field and frequencies").with(self.table(both));
        section.extend(self.words().into_iter().map(Piece::Paragraph));
        for experiment in &self.experiments {
            section.push(experiment.peaks_table());
            section.push(experiment.additional());
        }
        section.with(Piece::list(self.warnings.iter().cloned()))
    }
}
