//! The runs of a campaign file, written out.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::file::{CampaignFile, RunOptions, RunSpec, Verb};
use super::pattern;
use super::run::Run;
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::files::Keyed;

/// Read a campaign file, and write out its runs in order, with names of their own. Runs that name no seed have
/// `seed`; what they read is not hashed yet.
///
/// # Errors
/// The input's fault, with file, line and key.
pub fn read(path: &Path, seed: u64) -> Result<(String, Vec<Run>)> {
    let file = CampaignFile::load(path)?;
    let place = path.display().to_string();
    let within = |e: Error| e.within(&place);
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
        runs = shared(runs, calibration.shares as usize);
    }
    Ok((file.name, runs))
}

/// Arguments of the campaign's verb.
fn options(file: &CampaignFile) -> Result<Vec<String>> {
    file.options.check(file.verb, "options")?;
    match (file.verb, &file.calibration) {
        (Verb::Calibrate, Some(_)) if file.options != RunOptions::default() => Err(Error::input(
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
fn product(file: &CampaignFile, base: &Path, seed: u64) -> Result<Vec<Run>> {
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
                    runs.push(Run {
                        name: name.join("-"),
                        verb: file.verb,
                        model: model.clone(),
                        data: data.clone(),
                        seed,
                        set: set.clone(),
                        options: options.clone(),
                        share: None,
                        inputs_sha256: Keyed::new(),
                    });
                }
            }
        }
    }
    Ok(runs)
}

/// The `k`-th of the runs that are listed.
fn listed(file: &CampaignFile, own: &RunSpec, k: usize, base: &Path, seed: u64) -> Result<Run> {
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
    Ok(Run {
        name: name.take().unwrap_or_else(|| stem(&model)),
        verb,
        data: own.data.as_ref().map(|d| base.join(d)),
        seed: own.seed.unwrap_or(seed),
        set: own.set.clone(),
        options: options.arguments(),
        share: None,
        inputs_sha256: Keyed::new(),
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
fn distinct(runs: &mut [Run], file: &CampaignFile) -> Result<()> {
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

/// The shares of calibrations, each a run; those of one have its folder.
fn shared(runs: Vec<Run>, n: usize) -> Vec<Run> {
    let share = |run: &Run, k: usize| Run {
        name: format!("{}-share-{k}", run.name),
        share: Some((run.name.clone(), [k, n])),
        ..run.clone()
    };
    let shares = |run: &Run| (1..=n).map(|k| share(run, k)).collect::<Vec<_>>();
    runs.iter().flat_map(shares).collect()
}
