//! Checks of a model file beyond what its types say, and errors that name file, line and key.

use std::collections::BTreeMap;

use super::model::{ModelFile, SCHEMA};
use super::prior::PriorSpec;
use crate::effect::{self, Effect, Scene};
use crate::error::{Error, Result};
use crate::field::spec::check_window;

/// Bounds further than this many prior standard deviations from the mean leave nothing of a prior.
const MOST_SDS: f64 = 8.0;

/// A map whose keys are all different: of two entries with one name, neither is likely to be the one that is meant.
pub fn unique<'de, D, T>(deserializer: D) -> std::result::Result<BTreeMap<String, T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: serde::Deserialize<'de>,
{
    struct Unique<T>(std::marker::PhantomData<T>);
    impl<'de, T: serde::Deserialize<'de>> serde::de::Visitor<'de> for Unique<T> {
        type Value = BTreeMap<String, T>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an object of values by parameter name")
        }

        fn visit_map<A: serde::de::MapAccess<'de>>(
            self,
            mut map: A,
        ) -> std::result::Result<Self::Value, A::Error> {
            let mut entries = BTreeMap::new();
            while let Some((name, value)) = map.next_entry::<String, T>()? {
                if entries.contains_key(&name) {
                    return Err(serde::de::Error::custom(format!(
                        "a second {name}, expected every name once"
                    )));
                }
                entries.insert(name, value);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_map(Unique(std::marker::PhantomData))
}

/// One line for what serde reports: file, line, key path, what was found and what was expected.
pub fn json_error(file: &str, key: &str, error: &serde_json::Error) -> Error {
    let text = error.to_string();
    let text = text.split(" at line ").next().unwrap_or_default();
    let place = format!("{file}:{}:{}", error.line(), error.column());
    let place = if key == "." {
        place
    } else {
        format!("{place}: {key}")
    };
    if let Some((found, expected)) = text.split_once(", expected ") {
        return Error::input(place, expected).found(found);
    }
    if let Some((place_in, expected)) = text.split_once(": expected ") {
        return Error::input(format!("{place}: {place_in}"), expected);
    }
    if let Some(expected) = text.strip_prefix("expected ") {
        return Error::input(place, format!("{expected} in JSON"))
            .found("something else")
            .hint("a value is missing here, or stands where none belongs: only one key is allowed within \"prior\", and \"truncate\" stands beside it");
    }
    let expected = match error.classify() {
        serde_json::error::Category::Syntax | serde_json::error::Category::Eof => "valid JSON",
        _ => "the keys of a model file",
    };
    Error::input(place, expected).found(text)
}

/// Check everything that serde cannot, and resolve the effects.
pub fn validate(file: &ModelFile) -> Result<Vec<&'static dyn Effect>> {
    if file.schema != SCHEMA {
        return Err(Error::input("schema", format!("\"{SCHEMA}\"")).found(&file.schema));
    }
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if file.name.is_empty() || file.name.starts_with('.') || !file.name.chars().all(plain) {
        return Err(Error::input(
            "name",
            "letters, digits, '-', '_' and '.', because it names run folders",
        )
        .found(&file.name));
    }
    file.specimen.validate()?;
    file.load.validate()?;
    file.reduced_model.validate()?;
    check_window(file.window_mm)?;
    validate_parameters(file)?;
    let fraction = file.likelihood.model_error_fraction;
    if !(0.0..1.0).contains(&fraction) {
        return Err(Error::input(
            "likelihood.model_error_fraction",
            "a fraction of at least 0 and below 1",
        )
        .found(fraction));
    }
    if let Some(noise) = file
        .likelihood
        .noise_nm
        .filter(|n| !(n.is_finite() && *n > 0.0))
    {
        return Err(Error::input("likelihood.noise_nm", "a number above 0").found(noise));
    }
    validate_plausible(file)?;
    for name in file.candidates.iter().flatten() {
        effect::find("candidates", name)?;
    }
    let declared = file
        .effects
        .iter()
        .map(|name| effect::find("effects", name))
        .collect::<Result<Vec<_>>>()?;
    for (k, name) in file.effects.iter().enumerate() {
        if file.effects[..k].contains(name) {
            return Err(Error::input("effects", "every effect at most once").found(name));
        }
    }
    Ok(effect::EFFECTS
        .iter()
        .filter(|e| declared.iter().any(|d| d.name() == e.name()))
        .copied()
        .collect())
}

/// Every name is that of an effect's parameter, and every size can be a standard deviation.
fn validate_plausible(file: &ModelFile) -> Result<()> {
    let mut known = effect::EFFECTS
        .iter()
        .flat_map(|e| e.parameters().iter().map(|p| effect::amplitude_name(*e, p)));
    for (name, &sd) in &file.plausible {
        if !known.clone().any(|k| k == *name) {
            let known: Vec<_> = known.by_ref().collect();
            return Err(
                Error::input("plausible", format!("one of {}", known.join(", "))).found(name),
            );
        }
        if !(sd.is_finite() && sd > 0.0) {
            return Err(Error::input(
                format!("plausible.{name}"),
                "a finite standard deviation above 0, in the parameter's unit",
            )
            .found(sd));
        }
    }
    Ok(())
}

/// Declared effects must be able to act, and their amplitudes to be estimated.
pub fn validate_effects(effects: &[&'static dyn Effect], scene: &Scene) -> Result<()> {
    for effect in effects {
        if let Some(reason) = effect.obstacle(scene) {
            let expected = format!("effects that can act, which this one cannot: {reason}");
            return Err(Error::input("effects", expected).found(effect.name()));
        }
    }
    Ok(())
}

fn validate_parameters(file: &ModelFile) -> Result<()> {
    let names = file.specimen.material.constants();
    for name in file.parameters.keys() {
        if !names.contains(&name.as_str()) {
            return Err(Error::input(
                format!("parameters.{name}"),
                format!("only {}", names.join(", ")),
            )
            .found("an unknown parameter"));
        }
    }
    let mut means = Vec::new();
    for name in names {
        let place = format!("parameters.{name}");
        let spec = file
            .parameters
            .get(*name)
            .ok_or_else(|| Error::input(&place, "this parameter").found("no such key"))?;
        let PriorSpec::Normal { mean, sd } = spec.prior;
        if !mean.is_finite() {
            return Err(
                Error::input(format!("{place}.prior.normal.mean"), "a finite number").found(mean),
            );
        }
        if !(sd.is_finite() && sd > 0.0) {
            return Err(
                Error::input(format!("{place}.prior.normal.sd"), "a number above 0").found(sd),
            );
        }
        if let Some([low, high]) = spec
            .truncate
            .filter(|[low, high]| low.partial_cmp(high) != Some(std::cmp::Ordering::Less))
        {
            return Err(Error::input(
                format!("{place}.truncate"),
                "a lower bound below the upper bound",
            )
            .found(format!("[{low}, {high}]")));
        }
        if let Some([low, high]) = spec.truncate
            && (low > mean + MOST_SDS * sd || high < mean - MOST_SDS * sd)
        {
            return Err(Error::input(
                format!("{place}.truncate"),
                "bounds that leave some of the prior",
            )
            .found(format!("[{low}, {high}] with a prior of {mean} +- {sd}")));
        }
        means.push(mean);
    }
    file.specimen
        .material
        .ply(&means)
        .admissible("parameters: prior means")?;
    Ok(())
}
