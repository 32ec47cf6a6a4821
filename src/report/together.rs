//! Several experiments on one material: in `report.json`, on the terminal, on the page.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::json::{Keyed, or_nan};
use super::round::MeanAndSd;
use crate::infer::{Moments, Tension};
use crate::quantity::chance;
use crate::section::{Piece, Section, Table, TableCell, row};
use crate::study::{ClosedStudy, Disagreement, ExperimentSection, PairTension};

/// What several experiments say alone, and how far they disagree.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct TogetherReport {
    /// The constants by the first experiment alone, with the effects that its model declares, and by all others together.
    pub field_alone: Keyed<MeanAndSd>,
    pub frequencies_alone: Keyed<MeanAndSd>,
    /// The disagreement of these two.
    pub tension: Option<TensionReport>,
    /// The same with the effects that a loop found, and a little of all others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tension_after: Option<TensionReport>,
    /// The constants by each experiment alone.
    #[serde(default)]
    pub alone: Keyed<Keyed<MeanAndSd>>,
    /// The disagreement of every two experiments, and of each and all others where there are more than two.
    #[serde(default)]
    pub tensions: Vec<PairReport>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tensions_after: Vec<PairReport>,
    /// Effects that a loop found, by experiment.
    #[serde(default, skip_serializing_if = "Keyed::is_empty")]
    pub effects: Keyed<Vec<String>>,
    /// What the experiments say that have no report of their own.
    pub experiments: Vec<Value>,
    #[serde(default)]
    pub sections: Vec<ExperimentSection>,
    /// What should be known of the other experiments before the numbers are used.
    pub warnings: Vec<String>,
}

/// How far two posteriors of one material disagree.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TensionReport {
    /// Difference of the posterior means, the first less the second, and its sd if both saw one material.
    pub difference: Keyed<MeanAndSd>,
    pub chi2: f64,
    /// Directions in the space of the constants of which either says something.
    pub directions: usize,
    /// Probability of as much by chance.
    pub p: f64,
    /// For one material against one for each experiment.
    #[serde(deserialize_with = "or_nan")]
    pub log_bayes_factor: f64,
    /// All moduli by the first too large by so much, and the log Bayes factor for that against no such error.
    #[serde(default)]
    pub factor_percent: f64,
    #[serde(default)]
    pub factor_log_bayes_factor: f64,
    #[serde(default)]
    pub contradicts: bool,
}

impl TensionReport {
    pub fn new(tension: &Tension, names: &[&str]) -> Self {
        let difference = names.iter().zip(&tension.difference);
        Self {
            difference: difference
                .map(|(name, moments)| ((*name).to_string(), (*moments).into()))
                .collect(),
            chi2: tension.chi2,
            directions: tension.directions,
            p: tension.p,
            log_bayes_factor: tension.log_bayes_factor,
            factor_percent: tension.factor.percent,
            factor_log_bayes_factor: tension.factor.log_bayes_factor,
            contradicts: tension.contradicts(),
        }
    }

    fn words(&self) -> String {
        let bayes = match self.log_bayes_factor {
            b if b.is_finite() => format!("; log Bayes factor {b:+.1} for one material"),
            _ => String::new(),
        };
        let figures = format!(
            "chi2 {:.1} in {} directions, {}{bayes}",
            self.chi2,
            self.directions,
            chance(self.p)
        );
        if !self.contradicts {
            return format!("they agree ({figures})");
        }
        let percent = self.factor_percent;
        format!(
            "they contradict each other ({figures}). All moduli of the first would be {percent:+.1} % off: its force, a thickness, a width, or another batch"
        )
    }
}

/// How far an experiment disagrees with another.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PairReport {
    pub first: String,
    /// None for all others together.
    pub second: Option<String>,
    #[serde(flatten)]
    pub tension: TensionReport,
}

impl PairReport {
    fn new(pair: &PairTension, names: &[&str]) -> Self {
        Self {
            first: pair.first.clone(),
            second: pair.second.clone(),
            tension: TensionReport::new(&pair.tension, names),
        }
    }

    fn words(&self, under: &str) -> String {
        let second = self.second.as_deref().unwrap_or("all others");
        format!(
            "{} and {second}, {under}: {}.",
            self.first,
            self.tension.words()
        )
    }
}

fn keyed(moments: &Moments, names: &[&str]) -> Keyed<MeanAndSd> {
    let constant = |(k, name): (usize, &&str)| {
        let found = (moments.mean[k], moments.covariance[(k, k)].sqrt());
        ((*name).to_string(), found.into())
    };
    names.iter().enumerate().map(constant).collect()
}

impl TogetherReport {
    /// Of experiments with these names of their constants.
    pub fn new(together: &Disagreement, names: &[&str]) -> Self {
        let alone = together.alone.iter();
        let pairs = together.tensions.iter();
        let first = together.alone.first().map(|(_, m)| keyed(m, names));
        Self {
            field_alone: first.unwrap_or_default(),
            frequencies_alone: together
                .others
                .as_ref()
                .map_or_else(Keyed::default, |m| keyed(m, names)),
            tension: together
                .first
                .as_ref()
                .map(|t| TensionReport::new(t, names)),
            alone: alone
                .map(|(name, m)| (name.clone(), keyed(m, names)))
                .collect(),
            tensions: pairs.map(|p| PairReport::new(p, names)).collect(),
            experiments: together.sections.iter().map(|s| s.value.clone()).collect(),
            sections: together.sections.clone(),
            warnings: together.warnings.clone(),
            ..Self::default()
        }
    }

    /// Of a loop over all experiments.
    pub fn closed(closed: &ClosedStudy, names: &[&str]) -> Self {
        let after = &closed.after;
        let pairs = after.tensions.iter();
        let mut effects: Keyed<Vec<String>> = Keyed::default();
        for field in &closed.fields {
            let found = field.closed.conclusion.effects.clone();
            let name = closed.study.experiments[field.place].name();
            effects.insert(name.into(), found);
        }
        for (name, effect) in &closed.declared {
            effects.insert(name.clone(), vec![effect.name.into()]);
        }
        Self {
            tension_after: after.first.as_ref().map(|t| TensionReport::new(t, names)),
            tensions_after: pairs.map(|p| PairReport::new(p, names)).collect(),
            effects,
            experiments: after.sections.iter().map(|s| s.value.clone()).collect(),
            sections: after.sections.clone(),
            warnings: after.warnings.clone(),
            ..Self::new(&closed.before, names)
        }
    }

    /// Whether the models as they were given contradict each other.
    pub fn contradicts(&self) -> bool {
        self.tensions.iter().any(|t| t.tension.contradicts)
    }

    /// What the disagreement means, in sentences.
    fn words(&self) -> Vec<String> {
        let given = self.tensions.iter();
        let mut said: Vec<String> = given
            .map(|t| t.words("each with the model as it was given"))
            .collect();
        let after = self.tensions_after.iter();
        said.extend(after.map(|t| t.words("with what the loop found")));
        for (name, effects) in &self.effects {
            if !effects.is_empty() {
                said.push(format!("Found in {name}: {}.", effects.join(", ")));
            }
        }
        if self.tensions_after.is_empty() && self.contradicts() {
            said.push("A model lacks something: `plychain loop` seeks it in each experiment. Do not use constants that average over the contradiction.".into());
        }
        said
    }

    /// The constants by each experiment and by all; `both` has the last.
    fn table(&self, both: &Keyed<MeanAndSd>) -> Table {
        let moments = |m: Option<&MeanAndSd>| TableCell::mean_sd(m.copied());
        let apart = |name: &str| {
            let difference = self.tension.as_ref()?.difference.get(name)?;
            Some(difference.mean / difference.sd)
        };
        let is_pair = self.alone.len() == 2;
        let mut header = vec![String::new()];
        header.extend(self.alone.keys().map(|name| format!("{name} alone")));
        header.extend(is_pair.then(|| "apart, sd".to_string()));
        header.push("all together".into());
        let rows = self.field_alone.keys().map(|name| {
            let alone = self.alone.values().map(|m| moments(m.get(name)));
            let apart = is_pair.then(|| TableCell::signed(apart(name), 1));
            row(name, alone.chain(apart).chain([moments(both.get(name))]))
        });
        Table::new("", header, rows)
    }

    /// The constants by all, the disagreements, and what the experiments say that have no report of their own.
    pub fn section(&self, both: &Keyed<MeanAndSd>) -> Section {
        let mut section = Section::new("All experiments").with(self.table(both));
        section.extend(self.words().into_iter().map(Piece::Paragraph));
        for own in &self.sections {
            section.push(Piece::Heading(own.name.clone()));
            section.extend(own.pieces.iter().cloned());
        }
        section.with(Piece::list(self.warnings.iter().cloned()))
    }
}

/// An experiment's own section.
pub(super) fn experiment_section(own: &ExperimentSection) -> Section {
    Section::new(&own.name).with_all(own.pieces.iter().cloned())
}
