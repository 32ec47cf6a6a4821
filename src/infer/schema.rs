//! The model file, version 2: a material and what was measured of it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::kinds::{self, Apart};
use super::prior::PriorSpec;
use super::version1;
use crate::effect::Effect;
use crate::error::{Error, Result};
use crate::experiment::frequencies::FrequenciesSpec;
use crate::experiment::{ExperimentSpec, check_name};
use crate::files::{parse_json, unique};
use crate::laminate::{Material, MeanSd};
use crate::reduce::ReducedSpec;

/// The schema that this program writes. It reads `version1::SCHEMA` too.
pub const SCHEMA: &str = "plychain-model/2";

/// A model file. Unknown keys are errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Name, which also names run folders.
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The material that all experiments share.
    pub material: MaterialSpec,
    /// The field that was measured: one.
    pub experiments: Vec<ExperimentSpec>,
    /// Frequencies of plates of the same material; they stand among the experiments of the file.
    #[serde(skip)]
    pub frequencies: Vec<FrequenciesSpec>,
    pub reduced_model: ReducedSpec,
    pub likelihood: LikelihoodSpec,
}

/// The `material` object.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// How the stiffness is parameterised.
    pub kind: Material,
    /// Elastic constants and their priors.
    #[serde(deserialize_with = "unique")]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// Thermal expansion of a ply along and across its fibres, 1/K; (-0.2, 32) e-6/K for plies that do not say.
    #[serde(
        rename = "expansion_per_K",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub expansion_per_k: Option<[f64; 2]>,
    /// Yield stress of a metal, MPa: what the effect `yielding` needs.
    #[serde(rename = "yield_MPa", default, skip_serializing_if = "Option::is_none")]
    pub yield_mpa: Option<MeanSd>,
}

/// One entry of `parameters`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    pub prior: PriorSpec,
    /// Bounds at which the prior is cut, as in the article's Table 5; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncate: Option<[f64; 2]>,
    /// What others found, to be printed beside the posterior; nothing is inferred from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<MeanSd>,
}

/// The `likelihood` object.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LikelihoodSpec {
    /// Standard deviation of unnamed model errors, as a fraction of each POD coefficient's mean size.
    pub model_error_fraction: f64,
    /// Noise sd of a point in nm, where it is known; it is sampled otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_nm: Option<f64>,
}

/// Bounds further than this many prior standard deviations from the mean leave nothing of a prior.
const MOST_SDS: f64 = 8.0;

/// Where the parts of a model file stand in a version of the schema.
struct Paths {
    material: &'static str,
    experiment: &'static str,
}

/// Parse and check a model file of either version; `place` is the file. The effects that the experiment declares come
/// with it, in the order of the dictionary.
///
/// # Errors
/// The input's fault, with the line or the key as the file's own version has it.
pub fn parse(text: &str, place: &str) -> Result<(ModelFile, Vec<&'static dyn Effect>)> {
    #[derive(Deserialize)]
    struct Header {
        schema: Option<String>,
    }
    // Text that is no JSON is left to the parser of the whole file, whose error knows the key.
    let header: Option<Header> = serde_json::from_str(text).ok();
    let (mut file, paths) = match header.and_then(|h| h.schema).as_deref() {
        Some(version1::SCHEMA) => (
            version1::parse(text, place)?,
            Paths {
                material: "",
                experiment: "",
            },
        ),
        None | Some(SCHEMA) => (
            parse2(text, place)?,
            Paths {
                material: "material.",
                experiment: "experiments[0].",
            },
        ),
        Some(other) => {
            let expected = format!("\"{SCHEMA}\", or \"{}\"", version1::SCHEMA);
            return Err(Error::input(format!("{place}: schema"), expected).found(other));
        }
    };
    for experiment in &mut file.experiments {
        experiment.declare_introductions();
    }
    let effects = validate(&file, &paths).map_err(|e| e.within(place))?;
    Ok((file, effects))
}

/// A file of version 2, in which frequencies may stand beside the field.
fn parse2(text: &str, place: &str) -> Result<ModelFile> {
    let Some(Apart { text, frequencies }) = kinds::apart(text, place)? else {
        return parse_json(text, place);
    };
    let file = parse_json(&text, place)?;
    Ok(ModelFile {
        frequencies,
        ..file
    })
}

impl ModelFile {
    /// The file as it is written, all experiments in one list.
    ///
    /// # Errors
    /// Of the program: a value that JSON cannot hold.
    pub fn to_json(&self) -> Result<Value> {
        let fail = |e| Error::program("model.json", "a model that JSON can hold").found(e);
        let mut file = serde_json::to_value(self).map_err(fail)?;
        for own in &self.frequencies {
            let own = serde_json::to_value(own).map_err(fail)?;
            if let Some(experiments) = file["experiments"].as_array_mut() {
                experiments.push(own);
            }
        }
        Ok(file)
    }
}

/// Check everything that the types cannot, and resolve the effects.
fn validate(file: &ModelFile, paths: &Paths) -> Result<Vec<&'static dyn Effect>> {
    check_name(&file.name, "run folders")?;
    let [experiment] = &file.experiments[..] else {
        return Err(Error::input(
            "experiments",
            "one field, alone or beside frequencies",
        )
        .found(format!("{} fields", file.experiments.len()))
        .hint("load steps of one specimen are a series, \"steps\"; a field of another specimen needs a file of its own"));
    };
    let others = file.frequencies.iter().map(|f| &*f.name);
    kinds::names_differ(std::iter::once(&*experiment.name).chain(others))?;
    let isotropic = file.material.kind == Material::Isotropic;
    for own in &file.frequencies {
        own.validate(isotropic)
            .map_err(|e| e.below(format!("experiments: {}: ", own.name)))?;
    }
    let effects = experiment
        .validate(file.material.kind)
        .map_err(|e| e.below(paths.experiment))?;
    file.reduced_model.validate()?;
    file.material
        .validate()
        .map_err(|e| e.below(paths.material))?;
    let fraction = file.likelihood.model_error_fraction;
    if !(0.0..1.0).contains(&fraction) {
        return Err(Error::input(
            "likelihood.model_error_fraction",
            "a fraction of at least 0 and below 1",
        )
        .found(fraction));
    }
    if let Some(noise) = file.likelihood.noise_nm.filter(|n| *n <= 0.0) {
        return Err(Error::input("likelihood.noise_nm", "a number above 0").found(noise));
    }
    Ok(effects)
}

impl MaterialSpec {
    /// The constants are those of the kind, each with a prior that can be one; the prior means are an admissible ply.
    pub(super) fn validate(&self) -> Result<()> {
        let names = self.kind.constants();
        if let Some(unknown) = self
            .parameters
            .keys()
            .find(|n| !names.contains(&n.as_str()))
        {
            let expected = format!("only {}", names.join(", "));
            return Err(Error::input(format!("parameters.{unknown}"), expected)
                .found("an unknown parameter"));
        }
        let mut means = Vec::new();
        for name in names {
            let place = format!("parameters.{name}");
            let spec = self
                .parameters
                .get(*name)
                .ok_or_else(|| Error::input(&place, "this parameter").found("no such key"))?;
            means.push(spec.validate().map_err(|e| e.below(format!("{place}.")))?);
        }
        if let Some(stress) = self.yield_mpa {
            stress.validate("yield_MPa")?;
        }
        self.kind
            .ply(&means)
            .admissible("parameters: prior means")
            .map(|_| ())
    }
}

impl ParameterSpec {
    /// The prior's mean, if it is one of a prior.
    fn validate(&self) -> Result<f64> {
        let PriorSpec::Normal { mean, sd } = self.prior;
        if sd <= 0.0 {
            return Err(Error::input("prior.normal.sd", "a number above 0").found(sd));
        }
        if let Some([low, high]) = self.truncate.filter(|[low, high]| low >= high) {
            return Err(
                Error::input("truncate", "a lower bound below the upper bound")
                    .found(format!("[{low}, {high}]")),
            );
        }
        if let Some([low, high]) = self.truncate
            && (low > mean + MOST_SDS * sd || high < mean - MOST_SDS * sd)
        {
            return Err(
                Error::input("truncate", "bounds that leave some of the prior")
                    .found(format!("[{low}, {high}] with a prior of {mean} +- {sd}")),
            );
        }
        if let Some(published) = self.published {
            published.validate("published")?;
        }
        Ok(mean)
    }
}
