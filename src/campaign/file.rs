//! The campaign file: which models, data and seeds are run, and how.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::calibration::CalibrationSpec;
use super::pattern;
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::files::{Keyed, parse_json};

/// The schema of a campaign file.
pub const SCHEMA: &str = "plychain-campaign/1";

/// What is done to every model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verb {
    Identify,
    #[default]
    Loop,
    /// Simulation-based calibration, `validate --sbc`.
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
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    pub schema: String,
    /// Names the campaign's folder.
    pub name: String,
    #[serde(default)]
    pub note: Option<String>,
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
    pub options: Options,
    /// Of the verb `calibrate`, and of no other.
    #[serde(default)]
    pub calibration: Option<CalibrationSpec>,
    /// Runs beside those of models x data x sweep x seeds.
    #[serde(default)]
    pub runs: Vec<RunSpec>,
}

/// A run named on its own.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSpec {
    #[serde(default)]
    pub name: Option<String>,
    pub model: PathBuf,
    #[serde(default)]
    pub data: Option<PathBuf>,
    #[serde(default)]
    pub seed: Option<u64>,
    /// The campaign's where it says nothing.
    #[serde(default)]
    pub verb: Option<Verb>,
    #[serde(default)]
    pub options: Option<Options>,
    /// Values by key of the model file.
    #[serde(default)]
    pub set: Keyed<Value>,
}

/// Options of a run, as the command line has them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Most effects that a loop adds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounds: Option<u8>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampler: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_draws: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_ess: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_s: Option<f64>,
    #[serde(default)]
    pub full_order: bool,
}

impl Options {
    /// As arguments of a verb.
    pub fn arguments(&self) -> Vec<String> {
        let text = |name: &str, value: Option<String>| {
            let value = value.into_iter();
            value
                .flat_map(|v| [format!("--{name}"), v])
                .collect::<Vec<_>>()
        };
        let mut all = [
            text("rounds", self.rounds.map(|v| v.to_string())),
            text("sampler", self.sampler.clone()),
            text("max-draws", self.max_draws.map(|v| v.to_string())),
            text("min-ess", self.min_ess.map(|v| v.to_string())),
            text("time-limit", self.time_limit_s.map(|v| v.to_string())),
        ]
        .concat();
        if self.full_order {
            all.push("--full-order".into());
        }
        all
    }

    /// What a verb does not have, or no run can have.
    fn check(&self, verb: Verb, place: &str) -> Result<()> {
        let refuse = |key: &str, expected: &str| {
            Err(Error::input(format!("{place}.{key}"), expected.to_string()))
        };
        if verb != Verb::Loop && self.rounds.is_some() {
            return refuse("rounds", "no such key: only a loop has rounds");
        }
        if self.rounds.is_some_and(|r| r > 20) {
            return refuse("rounds", "a number from 0 to 20");
        }
        let known = || crate::sample::SAMPLERS.iter().map(|s| s.name);
        if let Some(name) = &self.sampler
            && !known().any(|k| k == name)
        {
            let known: Vec<_> = known().collect();
            let expected = format!("one of {}", known.join(", "));
            return Err(Error::input(format!("{place}.sampler"), expected).found(name));
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

/// A run before anything is read of it.
#[derive(Debug, Clone)]
pub struct Declared {
    pub name: String,
    pub verb: Verb,
    pub model: PathBuf,
    pub data: Option<PathBuf>,
    pub seed: u64,
    pub set: Keyed<Value>,
    /// Arguments of the verb.
    pub options: Vec<String>,
    /// Share K of N of a calibration, and the folder that all of them have.
    pub share: Option<(String, [usize; 2])>,
}

/// Read a campaign file, and write out its runs in order, with names of their own. Seeds are counted from `seed` where none are given.
///
/// # Errors
/// The input's fault, with file, line and key.
pub fn read(path: &Path, seed: u64) -> Result<(String, Vec<Declared>)> {
    let place = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::input(&place, "a readable campaign file").found(e))?;
    let file: CampaignFile = parse_json(&text, &place)?;
    let within = |e: Error| e.within(&place);
    if file.schema != SCHEMA {
        return Err(
            Error::input(format!("{place}: schema"), format!("\"{SCHEMA}\"")).found(&file.schema),
        );
    }
    check_name(&file.name, "the campaign's folder").map_err(within)?;
    let base = path.parent().unwrap_or(Path::new(""));
    let mut runs = product(&file, base, seed).map_err(within)?;
    for (k, own) in file.runs.iter().enumerate() {
        runs.push(listed(&file, own, k, base, seed).map_err(within)?);
    }
    if runs.is_empty() {
        return Err(Error::input(&place, "runs: \"models\", or \"runs\"").found("none"));
    }
    distinct(&mut runs, &file).map_err(within)?;
    if let Some(calibration) = &file.calibration {
        runs = calibration.shared(runs);
    }
    Ok((file.name, runs))
}

/// Arguments of the campaign's verb.
fn options(file: &CampaignFile) -> Result<Vec<String>> {
    file.options.check(file.verb, "options")?;
    match (file.verb, &file.calibration) {
        (Verb::Calibrate, Some(_)) if file.options != Options::default() => Err(Error::input(
            "options",
            "no such key beside \"calibration\"",
        )),
        (Verb::Calibrate, Some(calibration)) => calibration.arguments(),
        (Verb::Calibrate, None) => Err(Error::input(
            "calibration",
            "{\"replicates\": N, \"shares\": N}, which the verb calibrate needs",
        )),
        (_, Some(_)) => {
            Err(Error::input("calibration", "the verb calibrate").found(file.verb.name()))
        }
        (_, None) => Ok(file.options.arguments()),
    }
}

/// Models x data x sweep x seeds.
fn product(file: &CampaignFile, base: &Path, seed: u64) -> Result<Vec<Declared>> {
    let options = options(file)?;
    if file.models.is_empty() {
        let needless = !(file.data.is_empty() && file.seeds.is_empty() && file.sweep.is_empty());
        return match needless {
            true => {
                Err(Error::input("models", "the models of data, seeds and sweep").found("none"))
            }
            false => Ok(Vec::new()),
        };
    }
    let models = pattern::expand(&file.models, base, "models")?;
    let mut data: Vec<Option<PathBuf>> = pattern::expand(&file.data, base, "data")?
        .into_iter()
        .map(Some)
        .collect();
    if data.is_empty() {
        data.push(None);
    }
    let points = combinations(&file.sweep)?;
    let seeds = match file.seeds.is_empty() {
        true => vec![seed],
        false => file.seeds.clone(),
    };
    let mut runs = Vec::new();
    for model in &models {
        for data in &data {
            for (place, set) in points.iter().enumerate() {
                for &seed in &seeds {
                    let mut name = vec![stem(model)];
                    name.extend(data.as_deref().map(stem));
                    if points.len() > 1 {
                        name.push(format!("point-{}", place + 1));
                    }
                    if seeds.len() > 1 {
                        name.push(format!("seed-{seed}"));
                    }
                    runs.push(Declared {
                        name: name.join("-"),
                        verb: file.verb,
                        model: model.clone(),
                        data: data.clone(),
                        seed,
                        set: set.clone(),
                        options: options.clone(),
                        share: None,
                    });
                }
            }
        }
    }
    Ok(runs)
}

/// The `k`-th of the runs that are listed.
fn listed(
    file: &CampaignFile,
    own: &RunSpec,
    k: usize,
    base: &Path,
    seed: u64,
) -> Result<Declared> {
    let verb = own.verb.unwrap_or(file.verb);
    let (options, place) = match &own.options {
        Some(options) => (options, format!("runs[{k}].options")),
        None => (&file.options, "options".to_string()),
    };
    options.check(verb, &place)?;
    if verb == Verb::Calibrate {
        return Err(
            Error::input(format!("runs[{k}]"), "a run of identify or loop")
                .found("calibrate")
                .hint("a campaign that calibrates has models"),
        );
    }
    let mut name = own.name.clone();
    if let Some(name) = &name {
        check_name(name, "the run's folder").map_err(|e| e.below(format!("runs[{k}].")))?;
    }
    let model = base.join(&own.model);
    Ok(Declared {
        name: name.take().unwrap_or_else(|| stem(&model)),
        verb,
        data: own.data.as_ref().map(|d| base.join(d)),
        seed: own.seed.unwrap_or(seed),
        set: own.set.clone(),
        options: options.arguments(),
        share: None,
        model,
    })
}

/// Every combination of the values of a sweep, the last key's values next to each other.
fn combinations(sweep: &Keyed<Vec<Value>>) -> Result<Vec<Keyed<Value>>> {
    let mut all = vec![Keyed::new()];
    for (key, values) in sweep {
        if values.is_empty() {
            return Err(Error::input(format!("sweep.{key}"), "values").found("an empty list"));
        }
        let with = |point: &Keyed<Value>, value: &Value| {
            let mut point = point.clone();
            point.insert(key.clone(), value.clone());
            point
        };
        all = all
            .iter()
            .flat_map(|point| values.iter().map(move |v| with(point, v)))
            .collect();
    }
    Ok(all)
}

/// Runs of one name get numbers; a name that is given may stand once.
fn distinct(runs: &mut [Declared], file: &CampaignFile) -> Result<()> {
    let given = |name: &str| file.runs.iter().any(|r| r.name.as_deref() == Some(name));
    let mut seen = std::collections::BTreeSet::new();
    for run in runs {
        let mut name = run.name.clone();
        let mut k = 1;
        while !seen.insert(name.clone()) {
            if given(&run.name) {
                return Err(Error::input("runs", "names that differ").found(&run.name));
            }
            k += 1;
            name = format!("{}-{k}", run.name);
        }
        run.name = name;
    }
    Ok(())
}

/// A file's name without its ending, of characters that a folder's name may have.
fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |c: char| match c.is_ascii_alphanumeric() || "-_.".contains(c) {
        true => c,
        false => '_',
    };
    let name: String = stem.trim_start_matches('.').chars().map(plain).collect();
    if name.is_empty() { "run".into() } else { name }
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
