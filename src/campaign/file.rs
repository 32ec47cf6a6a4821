//! The campaign file: which models, data and seeds are run, and how.

use std::path::{Path, PathBuf};

use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use serde_with::skip_serializing_none;

use super::calibration::CalibrationSpec;
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::files::{Keyed, parse_json};

/// The schema of a campaign file.
pub const SCHEMA: &str = "plychain-campaign/1";

/// What is done to every model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verb {
    Identify,
    #[default]
    Loop,
    /// Simulation-based calibration, `validate --calibrate`.
    Calibrate,
}

impl Verb {
    pub fn name(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Loop => "loop",
            Self::Calibrate => "validate",
        }
    }
}

/// A campaign file. Unknown keys are errors.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    pub schema: String,
    /// Names the campaign's folder.
    pub name: String,
    /// For people.
    #[serde(default)]
    pub note: IgnoredAny,
    #[serde(default)]
    pub verb: Verb,
    /// Model files, or patterns of them (`*` and `?` in a file's name).
    #[serde(default, deserialize_with = "one_or_more")]
    pub models: Vec<String>,
    /// Data in place of each model's own.
    #[serde(default, deserialize_with = "one_or_more")]
    pub data: Vec<String>,
    #[serde(default, deserialize_with = "seeds")]
    pub seeds: Vec<u64>,
    /// Values by key of the model file (`experiments.0.load.force_N`): every combination is run.
    #[serde(default)]
    pub sweep: Keyed<Vec<Value>>,
    #[serde(default)]
    pub options: RunOptions,
    /// Of the verb `calibrate`, and of no other.
    pub calibration: Option<CalibrationSpec>,
    /// Runs beside those of models x data x sweep x seeds.
    #[serde(default)]
    pub runs: Vec<RunSpec>,
}

/// A run named on its own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSpec {
    pub name: Option<String>,
    pub model: PathBuf,

    pub data: Option<PathBuf>,

    pub seed: Option<u64>,
    /// The campaign's where it says nothing.
    pub verb: Option<Verb>,

    pub options: Option<RunOptions>,
    /// Values by key of the model file.
    #[serde(default)]
    pub set: Keyed<Value>,
}

/// Options of a run, as the command line has them.
#[skip_serializing_none]
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunOptions {
    /// Most effects that a loop adds.
    pub rounds: Option<u8>,
    pub sampler: Option<String>,
    pub max_draws: Option<usize>,
    pub min_ess: Option<f64>,
    pub time_limit_s: Option<f64>,
}

impl RunOptions {
    /// As arguments of a verb.
    pub fn arguments(&self) -> Vec<String> {
        let valued = [
            ("--rounds", self.rounds.map(|v| v.to_string())),
            ("--sampler", self.sampler.clone()),
            ("--max-draws", self.max_draws.map(|v| v.to_string())),
            ("--min-ess", self.min_ess.map(|v| v.to_string())),
            ("--time-limit", self.time_limit_s.map(|v| v.to_string())),
        ];
        let valued = valued.into_iter();
        let valued = valued.filter_map(|(option, value)| Some([option.into(), value?]));
        valued.flatten().collect()
    }

    /// What a verb does not have, or no run can have, is refused; `place` is the key.
    ///
    /// # Errors
    /// The input's fault, with the key.
    pub fn check(&self, verb: Verb, place: &str) -> Result<()> {
        let refuse = |key: &str, expected: &str| {
            Err(Error::input(format!("{place}.{key}"), expected.to_string()))
        };
        if verb != Verb::Loop && self.rounds.is_some() {
            return refuse("rounds", "no such key: only a loop has rounds");
        }
        if self.rounds.is_some_and(|r| r > 20) {
            return refuse("rounds", "a number from 0 to 20");
        }
        let known = crate::sample::SAMPLERS.iter().map(|s| s.name);
        if let Some(name) = &self.sampler
            && !known.clone().any(|k| k == name)
        {
            return Err(Error::one_of(format!("{place}.sampler"), known, name));
        }
        let positive = |v: Option<f64>| v.is_none_or(|v| v > 0.0 && v.is_finite());
        if self.max_draws == Some(0) {
            return refuse("max_draws", "a number above 0");
        }
        if !positive(self.min_ess) {
            return refuse("min_ess", "a number above 0");
        }
        if !positive(self.time_limit_s) {
            return refuse("time_limit_s", "a number of seconds above 0");
        }
        Ok(())
    }
}

impl CampaignFile {
    /// # Errors
    /// The input's fault, with file, line and key.
    pub fn load(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::input(&place, "a readable campaign file").found(e))?;
        let file: Self = parse_json(&text, &place)?;
        if file.schema != SCHEMA {
            return Err(
                Error::input(format!("{place}: schema"), format!("\"{SCHEMA}\""))
                    .found(&file.schema),
            );
        }
        check_name(&file.name, "the campaign's folder").map_err(|e| e.within(&place))?;
        Ok(file)
    }
}

fn one_or_more<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Vec<String>, D::Error> {
    const EXPECTED: &str = "a path, a pattern, or a list of them";
    let wrong = |found: &Value| serde::de::Error::custom(format!("{found}, expected {EXPECTED}"));
    match Value::deserialize(from)? {
        Value::String(one) => Ok(vec![one]),
        Value::Array(more) if !more.is_empty() => more
            .iter()
            .map(|v| v.as_str().map(String::from).ok_or_else(|| wrong(v)))
            .collect(),
        other => Err(wrong(&other)),
    }
}

/// Most seeds that a campaign counts.
const MOST_SEEDS: u64 = 1_000_000;

fn seeds<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Vec<u64>, D::Error> {
    const EXPECTED: &str = "a list of seeds, or {\"from\": SEED, \"count\": N}";
    let value = Value::deserialize(from)?;
    let wrong = || serde::de::Error::custom(format!("{value}, expected {EXPECTED}"));
    if let Some(list) = value.as_array().filter(|l| !l.is_empty()) {
        let seeds: Option<Vec<u64>> = list.iter().map(Value::as_u64).collect();
        return seeds.ok_or_else(wrong);
    }
    let object = value
        .as_object()
        .filter(|o| o.len() == 2)
        .ok_or_else(wrong)?;
    let number = |key: &str| object.get(key).and_then(Value::as_u64);
    let from = number("from").ok_or_else(wrong)?;
    let count = number("count").filter(|n| (1..=MOST_SEEDS).contains(n));
    let end = from
        .checked_add(count.ok_or_else(wrong)?)
        .ok_or_else(wrong)?;
    Ok((from..end).collect())
}
