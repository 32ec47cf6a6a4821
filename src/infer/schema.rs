//! The model file, version 2: a material and what was measured of it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use serde_with::skip_serializing_none;

use super::prior::{Marginal, PriorSpec};
use crate::effect::{Effect, amplitude_name, force_scale, width_error};
use crate::error::{Error, Result};
use crate::experiment::{ExperimentKind, ExperimentSpec, check_name};
use crate::files::{parse_json, parse_json_within, unique};
use crate::laminate::{Material, MeanSd};
use crate::parameter::is_modulus;
use crate::reduce::ReducedSpec;

/// The schema of a model file.
pub const SCHEMA: &str = "plychain-model/2";

/// What a model file says of a field and its material.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize)]
pub struct ModelFile {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Name, which also names run folders.
    pub name: String,
    pub note: Option<String>,
    pub run: Option<RunNote>,
    pub material: MaterialSpec,
    /// The field that was measured: one.
    pub experiments: Vec<ExperimentSpec>,
    pub reduced_model: ReducedSpec,
    pub likelihood: LikelihoodSpec,
}

/// The `run` object.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunNote {
    /// Operator, specimen, date: what the report has below its title.
    pub note: String,
}

/// The `material` object.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// How the stiffness is parameterised.
    pub kind: Material,
    /// Elastic constants and their priors.
    #[serde(deserialize_with = "unique")]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// Thermal expansion of a ply along and across its fibres, 1/K; (-0.2, 32) e-6/K for plies that do not say.
    #[serde(rename = "expansion_per_K")]
    pub expansion_per_k: Option<[f64; 2]>,
    /// Yield stress of a metal, MPa: what the effect `yielding` needs.
    #[serde(rename = "yield_MPa")]
    pub yield_mpa: Option<MeanSd>,
}

/// One entry of `parameters`.
#[skip_serializing_none]
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    pub prior: PriorSpec,
    /// Bounds at which the prior is cut, as in the article's Table 5; none by default.
    pub truncate: Option<[f64; 2]>,
    /// What others found, to be printed beside the posterior; nothing is inferred from it.
    pub published: Option<MeanSd>,
}

/// The `likelihood` object.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LikelihoodSpec {
    /// Read, and said to have no effect where it is not 0: it was the sd of unnamed model errors over each POD coefficient's mean size.
    #[serde(default)]
    pub model_error_fraction: f64,
    /// Noise sd of a point in nm, where it is known; it is sampled otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_nm: Option<f64>,
}

/// Bounds further than this many prior standard deviations from the mean leave nothing of a prior.
const MOST_SDS: f64 = 8.0;

/// Nothing is stiffer: diamond has 1220 GPa.
const STIFFEST_GPA: f64 = 2000.0;

/// No constant, nor the sd of one, is so large in any unit: squares of such numbers leave those that a computer has.
const LARGEST: f64 = 1e9;

/// A model file as far as it does not depend on the kinds of its experiments.
#[derive(Debug, Clone)]
pub struct ModelOutline {
    pub name: String,
    pub note: Option<String>,
    pub run: Option<RunNote>,
    /// The material that all experiments share.
    pub material: MaterialSpec,
    /// Of the fields among the experiments.
    pub reduced_model: Option<ReducedSpec>,
    pub likelihood: Option<LikelihoodSpec>,
    pub experiments: Vec<ExperimentEntry>,
}

/// An entry of `experiments` that is still to be read by its kind.
#[derive(Debug, Clone)]
pub struct ExperimentEntry {
    /// Its JSON value, and the place of the first character in the file, lines and columns from 0.
    json: String,
    start: [usize; 2],
    /// Key of the value in the file.
    key: String,
    place: String,
}

/// A file of version 2. Unknown keys are errors.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutlineFile<'a> {
    #[serde(rename = "schema")]
    _schema: String,
    name: String,
    note: Option<String>,
    run: Option<RunNote>,
    material: MaterialSpec,
    #[serde(default)]
    specimens: Map<String, Value>,
    #[serde(default)]
    load_cells: BTreeMap<String, LoadCell>,
    #[serde(borrow)]
    experiments: Vec<&'a RawValue>,
    reduced_model: Option<ReducedSpec>,
    likelihood: Option<LikelihoodSpec>,
}

/// What measures the forces of experiments.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadCell {
    /// Sd of the error of its scale.
    sd_percent: f64,
}

impl OutlineFile<'_> {
    /// The entry with what it names put in its place: a specimen, a load cell, the specimen and the load `of` another experiment. None of an
    /// entry that names nothing.
    fn resolved(&self, raw: &RawValue, key: &str) -> Result<Option<String>> {
        let mut entry: Value = serde_json::from_str(raw.get()).unwrap_or_default();
        let name = |entry: &Value, key: &str| entry[key].as_str().map(String::from);
        let unknown = |at: &str, expected: &str, name: &str| {
            Error::input(format!("{key}.{at}"), expected).found(name)
        };
        let mut is_changed = false;
        if let Some(other) = name(&entry, "of") {
            let mut all = self.experiments.iter();
            let found = all.find_map(|raw| {
                let value: Value = serde_json::from_str(raw.get()).ok()?;
                (name(&value, "name").as_ref() == Some(&other)).then_some(value)
            });
            let found = found.ok_or_else(|| unknown("of", "the name of an experiment", &other))?;
            for key in ["specimen", "load", "load_cell"] {
                if entry[key].is_null() && !found[key].is_null() {
                    entry[key] = found[key].clone();
                }
            }
            entry.as_object_mut().map(|keys| keys.remove("of"));
            is_changed = true;
        }
        if let Some(specimen) = name(&entry, "specimen") {
            let found = self.specimens.get(&specimen);
            let wrong = || unknown("specimen", "a name in specimens", &specimen);
            entry["specimen"] = found.ok_or_else(wrong)?.clone();
            is_changed = true;
        }
        // one of which nothing is declared is a name
        let cell = name(&entry, "load_cell").and_then(|cell| self.load_cells.get(&cell));
        let mut declare = |entry: &mut Value, effect: &dyn Effect, sd: f64| {
            let amplitude = amplitude_name(effect, &effect.parameters()[0]);
            if entry["plausible"][&amplitude].is_null() {
                entry["plausible"][&amplitude] = sd.into();
            }
            is_changed = true;
        };
        if let Some(LoadCell { sd_percent }) = cell {
            declare(&mut entry, force_scale(), *sd_percent);
        }
        let is_field = name(&entry, "kind").is_none_or(|k| ExperimentKind::try_from(k).is_ok());
        let width = entry["specimen"]["width_mm"].clone();
        if let Ok(MeanSd { mean, sd }) = MeanSd::deserialize(width)
            && is_field
        {
            entry["specimen"]["width_mm"] = mean.into();
            declare(&mut entry, width_error(), 100.0 * sd / mean);
        }
        Ok(is_changed.then(|| entry.to_string()))
    }
}

impl ExperimentEntry {
    /// What the entry says of its kind; nothing where it says nothing.
    pub fn kind(&self) -> String {
        #[derive(Deserialize)]
        struct EntryKind {
            #[serde(default)]
            kind: String,
        }
        serde_json::from_str::<EntryKind>(&self.json).map_or_else(|_| String::new(), |k| k.kind)
    }

    /// Whether a field was measured.
    pub fn is_field(&self) -> bool {
        ExperimentKind::try_from(self.kind()).is_ok()
    }

    /// The entry as the type of its kind has it.
    ///
    /// # Errors
    /// The input's fault, with line and key in the whole file.
    pub fn read<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        parse_json_within(&self.json, &self.place, (self.start, &self.key))
    }

    /// An error of a key of this entry, with the key and the file put before it.
    pub fn refuse(&self, error: Error) -> Error {
        let key = &self.key;
        error.below(format!("{key}.")).within(&self.place)
    }
}

impl ModelOutline {
    /// Read the text of a model file; `place` is the file.
    ///
    /// # Errors
    /// The input's fault, with the line or the key.
    pub fn read(text: &str, place: &str) -> Result<Self> {
        // Text that is no JSON is left to the parser of the whole file, whose error knows the key.
        let header: Value = serde_json::from_str(text).unwrap_or_default();
        if let Some(other) = header["schema"].as_str().filter(|schema| *schema != SCHEMA) {
            return Err(Error::input(format!("{place}: schema"), format!("\"{SCHEMA}\""))
                .found(other)
                .hint("a file of another version: write a new one with `plychain init`, and copy the values"));
        }
        let outline = Self::of_text(text, place)?;
        let checked = check_name(&outline.name, "run folders")
            .and_then(|()| {
                outline
                    .material
                    .validate()
                    .map_err(|e| e.below("material."))
            })
            .and_then(|()| outline.likelihood.map_or(Ok(()), |l| l.validate()))
            .and_then(|()| {
                outline
                    .reduced_model
                    .as_ref()
                    .map_or(Ok(()), ReducedSpec::validate)
            });
        checked.map_err(|e| e.within(place))?;
        Ok(outline)
    }

    fn of_text(text: &str, place: &str) -> Result<Self> {
        let file: OutlineFile<'_> = parse_json(text, place)?;
        let entry = |(k, raw): (usize, &&RawValue)| {
            let key = format!("experiments[{k}]");
            let resolved = file.resolved(raw, &key).map_err(|e| e.within(place))?;
            if let Some(json) = resolved {
                return Ok(ExperimentEntry {
                    json,
                    start: [0; 2],
                    key,
                    place: place.into(),
                });
            }
            let before = &text[..raw.get().as_ptr() as usize - text.as_ptr() as usize];
            let line = before.matches('\n').count();
            let column = before.len() - before.rfind('\n').map_or(0, |at| at + 1);
            Ok(ExperimentEntry {
                json: raw.get().into(),
                start: [line, column],
                key,
                place: place.into(),
            })
        };
        let experiments = file.experiments.iter().enumerate().map(entry);
        let experiments: Vec<ExperimentEntry> = experiments.collect::<Result<_>>()?;
        Ok(Self {
            name: file.name,
            note: file.note,
            run: file.run,
            material: file.material,
            reduced_model: file.reduced_model,
            likelihood: file.likelihood,
            experiments,
        })
    }

    /// The field of an entry, with its material and the effects that it declares, in the order of the dictionary.
    ///
    /// # Errors
    /// The input's fault, with line and key.
    pub fn field(&self, entry: &ExperimentEntry) -> Result<(ModelFile, Vec<&'static dyn Effect>)> {
        let mut experiment: ExperimentSpec = entry.read()?;
        experiment.declare_introductions();
        let effects = experiment.validate(self.material.kind);
        let missing = |key: &str| {
            Error::input(&entry.place, "the keys that this file has")
                .found(format!("missing field `{key}`, which a field needs"))
        };
        let file = ModelFile {
            schema: SCHEMA.into(),
            name: self.name.clone(),
            note: self.note.clone(),
            run: self.run.clone(),
            material: self.material.clone(),
            experiments: vec![experiment],
            reduced_model: self
                .reduced_model
                .clone()
                .ok_or_else(|| missing("reduced_model"))?,
            likelihood: self.likelihood.ok_or_else(|| missing("likelihood"))?,
        };
        Ok((file, effects.map_err(|e| entry.refuse(e))?))
    }

    /// The one field among the experiments.
    ///
    /// # Errors
    /// The input's fault: none, or several.
    pub fn one_field(&self, place: &str) -> Result<&ExperimentEntry> {
        let mut fields = self.experiments.iter().filter(|e| e.is_field());
        match (fields.next(), fields.count(), self.experiments.first()) {
            (Some(field), 0, _) => Ok(field),
            // what is wrong with it is said when it is read as a field
            (None, _, Some(other)) => Ok(other),
            (found, more, _) => {
                let count = usize::from(found.is_some()) + more;
                Err(Error::input(format!("{place}: experiments"), "one field")
                    .found(format!("{count} fields"))
                    .hint("identify, loop, simulate, design and campaign take any number"))
            }
        }
    }
}

impl ModelFile {
    /// The file as it is written.
    ///
    /// # Errors
    /// Of the program: a value that JSON cannot hold.
    pub fn to_json(&self) -> Result<Value> {
        let fail = |e| Error::program("model.json", "a model that JSON can hold").found(e);
        serde_json::to_value(self).map_err(fail)
    }
}

impl LikelihoodSpec {
    fn validate(self) -> Result<()> {
        let fraction = self.model_error_fraction;
        if !(0.0..1.0).contains(&fraction) {
            return Err(Error::input(
                "likelihood.model_error_fraction",
                "a fraction of at least 0 and below 1",
            )
            .found(fraction));
        }
        if let Some(noise) = self.noise_nm.filter(|n| *n <= 0.0) {
            return Err(Error::input("likelihood.noise_nm", "a number above 0").found(noise));
        }
        Ok(())
    }
}

impl MaterialSpec {
    /// Names and priors of the elastic constants, in their canonical order.
    pub fn constants(&self) -> Vec<(String, Marginal)> {
        let prior = |name: &&str| {
            let spec = &self.parameters[*name];
            let PriorSpec::Normal { mean, sd } = spec.prior;
            let marginal = Marginal {
                mean,
                sd,
                truncate: spec.truncate,
            };
            ((*name).to_string(), marginal)
        };
        self.kind.constants().iter().map(prior).collect()
    }

    /// The constants are those of the kind, each with a prior that can be one; the prior means are an admissible ply.
    fn validate(&self) -> Result<()> {
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
            let mean = spec.validate().map_err(|e| e.below(format!("{place}.")))?;
            if is_modulus(name) && mean > STIFFEST_GPA {
                let expected = format!("a modulus in GPa, at most {STIFFEST_GPA}");
                return Err(Error::input(format!("{place}.prior.normal.mean"), expected)
                    .found(mean)
                    .hint(format!("is it in MPa? {mean} MPa are {} GPa", 1e-3 * mean)));
            }
            means.push(mean);
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
        if !(sd > 0.0 && sd < LARGEST) {
            let expected = format!("a number above 0 and below {LARGEST:e}");
            return Err(Error::input("prior.normal.sd", expected).found(sd));
        }
        if mean.abs() >= LARGEST {
            let expected = format!("a number below {LARGEST:e}");
            return Err(Error::input("prior.normal.mean", expected).found(mean));
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
