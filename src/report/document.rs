//! `report.json`: one [`Report`], whose types in this and the following files are the published schema.

use std::path::Path;

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::json::{Keyed, Versioned, part, read};
use super::learned::Learned;
use super::quoted::QuotedReport;
use super::round::{MeanAndSd, RoundReport};
use super::together::TogetherReport;
use super::verdict::BeforeAfter;
use crate::error::{Error, Result};
use crate::files;
use crate::section::Section;
use crate::trace::{BlindSpot, Conclusion, Interval};

/// The schema of `report.json`. Keys are only ever added to it.
pub const SCHEMA: &str = "plychain-report/1";

/// What a run found. Numbers that can be infinite or NaN are options: JSON has `null` for them.
#[derive(Debug, Serialize, Deserialize)]
pub struct Report {
    pub schema: String,
    pub model: String,
    pub seed: u64,
    /// One identification of `identify`; those of a loop in order, the first of the model as it was given.
    pub rounds: Vec<RoundReport>,
    /// All experiments, where the model has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub together: Option<TogetherReport>,
    /// The model file as it was given.
    #[serde(default)]
    pub told: Value,
    /// What the data added to the priors of the constants, by the interval to quote.
    #[serde(default)]
    pub learned: Keyed<Learned>,
    /// What a loop adds.
    #[serde(flatten, deserialize_with = "closing")]
    pub closing: Option<Closing>,
}

/// What a loop adds to its rounds.
#[derive(Debug, Serialize, Deserialize)]
pub struct Closing {
    /// The constants averaged over what may act unseen.
    pub averaged_posterior: Keyed<Interval>,
    /// How those were sampled, where they were.
    pub quoted: Option<QuotedReport>,
    /// Why that is wider, or narrower, than the posterior of the model alone.
    pub averaged_note: Option<String>,
    /// What could hide in the last residual.
    pub blind_spots: Vec<BlindSpot>,
    /// First and last round beside each other.
    pub before_after: BeforeAfter,
    pub verdict: Conclusion,
}

impl Report {
    /// The report in the folder of a finished run.
    ///
    /// # Errors
    /// The input's fault, with the file and the key, if it is missing, of another schema, or cannot be read.
    pub fn load(folder: &Path) -> Result<Self> {
        let (file, text) = read(folder, "report.json")?;
        let Versioned { schema } = files::parse_json(&text, &file)?;
        if schema != SCHEMA {
            return Err(Error::input(file, format!("\"schema\": \"{SCHEMA}\""))
                .found(schema)
                .hint("this run is of another version: identify anew"));
        }
        files::parse_json(&text, &file)
    }

    /// What could hide in the last residual of a loop.
    pub fn blind_spots(&self) -> &[BlindSpot] {
        self.closing.as_ref().map_or(&[], |c| &c.blind_spots)
    }

    /// An averaged constant of a loop.
    pub fn averaged(&self, name: &str) -> Option<&Interval> {
        self.closing.as_ref()?.averaged_posterior.get(name)
    }

    /// The constants by all experiments: those to quote of a loop, those of the last round otherwise.
    pub fn both(&self) -> Keyed<MeanAndSd> {
        let moments = |i: &Interval| MeanAndSd::from((i.mean, i.sd));
        match (&self.closing, self.last()) {
            (Some(closing), _) => {
                let quoted = closing.averaged_posterior.iter();
                quoted.map(|(name, i)| (name.clone(), moments(i))).collect()
            }
            (None, Some(round)) => round.alone(),
            (None, None) => Keyed::default(),
        }
    }

    /// What is said of several experiments, nothing of one.
    pub fn together_section(&self) -> Option<Section> {
        let together = self.together.as_ref();
        together.map(|t| t.section(&self.both()))
    }

    pub fn last(&self) -> Option<&RoundReport> {
        self.rounds.last()
    }
}

fn closing<'de, D: Deserializer<'de>>(rest: D) -> std::result::Result<Option<Closing>, D::Error> {
    part(rest, "verdict")
}
