//! The model file: everything an analyst declares about a test.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::prior::{Marginal, PriorSpec};
use super::validate::{json_error, unique, validate, validate_effects};
use crate::effect::{Effect, Kind, Scene, amplitude_name};
use crate::error::{Error, Result};
use crate::fem::{Density, Setup};
use crate::field::{Field, MeasurementSpec};
use crate::laminate::{LoadSpec, Material, SpecimenSpec};
use crate::reduce::{Dimension, Gauge, Problem, ReducedSpec, THICKNESS, check_gauge, exponents};

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
    /// Standard deviations of effects' amplitudes by `effect.parameter`, in its unit, in place of the dictionary's.
    #[serde(
        default,
        deserialize_with = "unique",
        skip_serializing_if = "BTreeMap::is_empty"
    )]
    pub plausible: BTreeMap<String, f64>,
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
        let model = Self {
            file,
            path: path.to_path_buf(),
            effects,
        };
        let scene = model.scene();
        validate_effects(&model.effects, &scene)
            .and_then(|()| check_gauge(model.file.gauge, &scene.frame, &scene.setup.outline))
            .map_err(|e| e.within(&place))?;
        Ok(model)
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

    /// Standard deviation of the normal prior of parameter `k` of an effect, in its unit: the model's, or the
    /// dictionary's; `None` where nothing bounds it.
    pub fn prior_sd(&self, effect: &dyn Effect, k: usize) -> Option<f64> {
        let parameter = &effect.parameters()[k];
        let own = self.file.plausible.get(&amplitude_name(effect, parameter));
        own.copied().or(parameter.prior_sd)
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
            window: field.measured_bounds(),
            density: Density::DEFAULT,
        };
        problem
            .validate()
            .map_err(|e| e.within(self.path.display()))?;
        Ok(problem)
    }

    /// The priors' means +- 3 sd, never below a quarter of a modulus' mean.
    pub fn prior_box(&self) -> Vec<Dimension> {
        self.constants()
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
            .collect()
    }

    /// Raise the number of snapshots to what a response surface of the model's parameters should have, half as many again as
    /// it has monomials.
    pub fn ask_for_snapshots(&mut self) {
        let effects = self.sampled();
        let amplitudes: usize = effects.iter().map(|e| e.parameters().len()).sum();
        let thickness = usize::from(self.file.specimen.thickness_mm.sd > 0.0);
        let reduced = &self.file.reduced_model;
        let variables = self.constants().len() + thickness + amplitudes;
        let wanted = 3 * exponents(variables, reduced.degree).len() / 2;
        self.file.reduced_model.snapshots = reduced.snapshots.max(wanted);
    }

    /// The DoE box: declared bounds, or [`Model::prior_box`], the thickness' mean +- 4 sd, and effects' amplitudes +- 3 prior sd.
    fn dimensions(&self) -> Result<Vec<Dimension>> {
        let mut dimensions = self.prior_box();
        let thickness = self.file.specimen.thickness_mm;
        if thickness.sd > 0.0 {
            dimensions.push(Dimension {
                name: THICKNESS.into(),
                low: thickness.mean - 4.0 * thickness.sd,
                high: thickness.mean + 4.0 * thickness.sd,
            });
        }
        for effect in self.sampled() {
            for (k, parameter) in effect.parameters().iter().enumerate() {
                let reach = self
                    .prior_sd(effect, k)
                    .map_or(parameter.bound, |sd| (BOX_SDS * sd).min(parameter.bound));
                dimensions.push(Dimension {
                    name: amplitude_name(effect, parameter),
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
