//! The model file: everything an analyst declares about a test.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::prior::{Marginal, PriorSpec};
use crate::effect::{self, Effect, Kind, Scene};
use crate::error::{Error, Result};
use crate::fem::{Density, Setup};
use crate::field::{Field, MeasurementSpec};
use crate::laminate::{LoadSpec, Material, SpecimenSpec};
use crate::reduce::{Dimension, Gauge, Problem, ReducedSpec, THICKNESS};

/// The schema that this program reads and writes.
pub const SCHEMA: &str = "plychain-model/1";

/// A model file. Unknown keys are errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Name, which also names run folders.
    pub name: String,
    /// Free text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The specimen.
    pub specimen: SpecimenSpec,
    /// The load.
    pub load: LoadSpec,
    /// How the rigid motion of predictions is fixed.
    #[serde(default)]
    pub gauge: Gauge,
    /// Elastic constants and their priors.
    #[serde(deserialize_with = "unique")]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// The measured field.
    pub measurement: MeasurementSpec,
    /// Restriction of the points used, `[[x0, y0], [x1, y1]]` in the data's frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window_mm: Option<[[f64; 2]; 2]>,
    /// Sizes of the reduced model.
    pub reduced_model: ReducedSpec,
    /// Constants of the likelihood.
    pub likelihood: LikelihoodSpec,
    /// Effects that the model declares.
    pub effects: Vec<String>,
    /// Effects that tracing may consider, in place of the whole dictionary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub candidates: Option<Vec<String>>,
}

/// One entry of `parameters`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// The prior.
    pub prior: PriorSpec,
    /// Bounds at which the prior is cut, as in the article's Table 5; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncate: Option<[f64; 2]>,
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

/// A validated model and where it came from.
#[derive(Clone)]
pub struct Model {
    /// The file as read.
    pub file: ModelFile,
    /// Its path.
    pub path: PathBuf,
    /// Declared effects, in the order of the dictionary.
    pub effects: Vec<&'static dyn Effect>,
}

/// Thermal expansion of a carbon/epoxy ply along and across its fibres, 1/K.
const CARBON_EPOXY_EXPANSION: [f64; 2] = [-0.2e-6, 32e-6];

/// Half-width of the default DoE box in prior standard deviations.
const BOX_SDS: f64 = 3.0;

/// Bounds further than this many prior standard deviations from the mean leave nothing of a prior.
const MOST_SDS: f64 = 8.0;

/// Smallest modulus of the default DoE box as a fraction of its prior mean.
const SMALLEST_MODULUS: f64 = 0.25;

impl Model {
    /// Read and validate a model file.
    pub fn load(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| {
            Error::input(&place, "a readable model file")
                .found(e)
                .hint("give the path of a model, for example models/openhole.json")
        })?;
        Self::parse(&text, path)
    }

    /// Parse and validate the text of a model file at `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let mut reader = serde_json::Deserializer::from_str(text);
        let file: ModelFile = serde_path_to_error::deserialize(&mut reader)
            .map_err(|e| json_error(&place, &e.path().to_string(), e.inner()))?;
        reader.end().map_err(|e| json_error(&place, ".", &e))?;
        let effects = validate(&file).map_err(|e| e.within(&place))?;
        Ok(Self {
            file,
            path: path.to_path_buf(),
            effects,
        })
    }

    /// The directory that relative paths of the model start from.
    pub fn base_dir(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Read the measured field and drop nothing but what the measurement's own rules drop.
    pub fn read_field(&self) -> Result<Field> {
        let field = self
            .file
            .measurement
            .read(self.base_dir(), self.file.window_mm)?;
        field
            .check_hole(0.5 * self.file.specimen.hole.diameter_mm)
            .map_err(|e| e.within(self.path.display()))?;
        Ok(field)
    }

    /// Marginal priors of the elastic constants, in their canonical order.
    pub fn marginals(&self) -> Vec<Marginal> {
        self.constants()
            .iter()
            .map(|name| {
                let spec = &self.file.parameters[*name];
                let PriorSpec::Normal { mean, sd } = spec.prior;
                Marginal {
                    mean,
                    sd,
                    truncate: spec.truncate,
                }
            })
            .collect()
    }

    /// Names of the elastic constants.
    pub fn constants(&self) -> &'static [&'static str] {
        self.file.specimen.material.constants()
    }

    /// Declared effects that need fields of their own, from the finite elements: mechanical and optical ones.
    pub fn sampled(&self) -> Vec<&'static dyn Effect> {
        self.effects
            .iter()
            .filter(|e| !matches!(e.kind(), Kind::Additive | Kind::Recorded))
            .copied()
            .collect()
    }

    /// Declared effects that add a known field.
    pub fn additive(&self) -> Vec<&'static dyn Effect> {
        self.effects
            .iter()
            .filter(|e| e.kind() == Kind::Additive)
            .copied()
            .collect()
    }

    /// What effects may need to know of the nominal test: prior means, mean thickness.
    pub fn scene(&self) -> Scene {
        let frame = self.file.measurement.frame;
        let specimen = &self.file.specimen;
        let means: Vec<f64> = self.marginals().iter().map(|m| m.mean).collect();
        let isotropic = specimen.material == Material::Isotropic;
        Scene {
            frame,
            setup: Setup::nominal(specimen, &self.file.load, frame.handedness()),
            ply: specimen.material.ply(&means),
            fringe_frequency_per_mm: self.file.measurement.fringe_frequency_per_mm,
            expansion_per_k: specimen
                .expansion_per_k
                .or((!isotropic).then_some(CARBON_EPOXY_EXPANSION)),
            isotropic,
        }
    }

    /// The reduced model's problem for a measured field.
    pub fn problem(&self, field: &Field) -> Result<Problem> {
        let problem = Problem {
            specimen: self.file.specimen.clone(),
            load: self.file.load,
            frame: field.frame,
            gauge: self.file.gauge,
            scene: self.scene(),
            effects: self.sampled(),
            dimensions: self.dimensions()?,
            spec: self.file.reduced_model.clone(),
            window: field.bounds(),
            density: Density::DEFAULT,
        };
        problem
            .validate()
            .map_err(|e| e.within(self.path.display()))?;
        Ok(problem)
    }

    /// The DoE box: declared bounds, or the priors' means +- 3 sd (never below a quarter of a modulus' mean), the
    /// thickness' mean +- 4 sd, and effects' amplitudes +- 3 prior sd.
    fn dimensions(&self) -> Result<Vec<Dimension>> {
        let mut dimensions: Vec<Dimension> = self
            .constants()
            .iter()
            .zip(self.marginals())
            .map(|(name, m)| {
                let low = m.mean - BOX_SDS * m.sd;
                let floor = if name.ends_with("_GPa") {
                    SMALLEST_MODULUS * m.mean
                } else {
                    f64::NEG_INFINITY
                };
                Dimension {
                    name: (*name).into(),
                    low: low.max(floor),
                    high: m.mean + BOX_SDS * m.sd,
                }
            })
            .collect();
        let thickness = self.file.specimen.thickness_mm;
        if thickness.sd > 0.0 {
            dimensions.push(Dimension {
                name: THICKNESS.into(),
                low: thickness.mean - 4.0 * thickness.sd,
                high: thickness.mean + 4.0 * thickness.sd,
            });
        }
        for effect in self.sampled() {
            for parameter in effect.parameters() {
                let reach = BOX_SDS * parameter.plausible.unwrap_or(parameter.bound / BOX_SDS);
                dimensions.push(Dimension {
                    name: effect::amplitude_name(effect, parameter),
                    low: -reach,
                    high: reach,
                });
            }
        }
        for (name, [low, high]) in self.file.reduced_model.doe.iter().flatten() {
            let known: Vec<_> = dimensions.iter().map(|d| d.name.clone()).collect();
            let Some(d) = dimensions.iter_mut().find(|d| d.name == *name) else {
                return Err(Error::input(
                    format!("{}: reduced_model.doe", self.path.display()),
                    format!("one of {}", known.join(", ")),
                )
                .found(name));
            };
            (d.low, d.high) = (*low, *high);
        }
        Ok(dimensions)
    }
}

/// A map whose keys are all different: of two entries with one name, neither is likely to be the one that is meant.
fn unique<'de, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<BTreeMap<String, ParameterSpec>, D::Error> {
    struct Unique;
    impl<'de> serde::de::Visitor<'de> for Unique {
        type Value = BTreeMap<String, ParameterSpec>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an object of parameters by name")
        }

        fn visit_map<A: serde::de::MapAccess<'de>>(
            self,
            mut map: A,
        ) -> std::result::Result<Self::Value, A::Error> {
            let mut entries = BTreeMap::new();
            while let Some((name, value)) = map.next_entry::<String, ParameterSpec>()? {
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
    deserializer.deserialize_map(Unique)
}

/// One line for what serde reports: file, line, key path, what was found and what was expected.
fn json_error(file: &str, key: &str, error: &serde_json::Error) -> Error {
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
    let expected = match error.classify() {
        serde_json::error::Category::Syntax | serde_json::error::Category::Eof => "valid JSON",
        _ => "the keys of a model file",
    };
    Error::input(place, expected).found(text)
}

/// Check everything that serde cannot, and resolve the effects.
fn validate(file: &ModelFile) -> Result<Vec<&'static dyn Effect>> {
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
