//! The model file: everything an analyst declares about a test.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::known::ConstantsLikelihood;
use super::prior::Marginal;
use super::schema::{ExperimentEntry, ModelFile, ModelOutline};
use crate::effect::{Acting, Effect, Scene, amplitude_name, why_not};
use crate::error::{Error, Result};
use crate::experiment::{ExperimentSpec, State, Subsets, check_gauge};
use crate::fem::Setup;
use crate::field::{Field, of_settings};
use crate::files::absolute;
use crate::laminate::Material;
use crate::reduce::SnapshotsSpec;

/// A validated model and where it came from.
#[derive(Clone)]
pub struct Model {
    pub file: ModelFile,
    pub path: PathBuf,
    /// Declared effects, in the order of the dictionary.
    pub effects: Vec<&'static dyn Effect>,
    /// What experiments beside the field say of the constants.
    pub known: Option<Arc<ConstantsLikelihood>>,
    /// Constants with which the specimen is bent out of its plane and expands, border units: the best known so far; the prior's means where
    /// there are none.
    pub nominal: Option<Vec<f64>>,
    /// The field, where it was measured by the caller and stands in no file.
    pub measured: Option<Arc<Field>>,
}

/// Prior sd of the scale of forces of which none is known, percent.
const UNKNOWN_FORCE_PERCENT: f64 = 30.0;

/// Prior sd of a motion in the plane, mm and, over the picture, rad: as good as none.
pub const FREE_MM: f64 = 10.0;

/// Thermal expansion of a carbon/epoxy ply along and across its fibres, 1/K.
const CARBON_EPOXY_EXPANSION: [f64; 2] = [-0.2e-6, 32e-6];

/// Camera distance that is assumed where none is declared, in specimen widths. Only motion divided by distance matters.
const ASSUMED_WIDTHS: f64 = 10.0;

impl Model {
    /// Read and validate a model file.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&Self::text(path)?, path)
    }

    /// The text of a model file.
    ///
    /// # Errors
    /// The input's fault: a file that cannot be read.
    pub fn text(path: &Path) -> Result<String> {
        let place = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| {
            Error::input(&place, "a readable model file")
                .found(e)
                .hint("give the path of a model, for example models/openhole.json")
        })?;
        let text = of_settings(path, &bytes)?;
        if text.trim_start().starts_with('{') {
            return Ok(text);
        }
        Err(Error::input(&place, "a model file, which begins with {")
            .found("a table or another text")
            .hint(format!("plychain init {place} makes a model of a table")))
    }

    /// Read a model, with its measurement elsewhere if `data` says so.
    ///
    /// # Errors
    /// Those of [`Model::load`]; data in place of a load series.
    pub fn load_with(path: &Path, data: Option<&PathBuf>) -> Result<Self> {
        let mut model = Self::load(path)?;
        if let Some(data) = data {
            model.measured_in(data)?;
        }
        Ok(model)
    }

    /// Take the measurement from elsewhere.
    ///
    /// # Errors
    /// The input's fault: data in place of a load series.
    pub fn measured_in(&mut self, data: &Path) -> Result<()> {
        let place = format!("--data {}", data.display());
        if self.experiment().steps.is_some() {
            return Err(Error::input(place, "a model with one measurement")
                .found("a load series")
                .hint("name the files in experiments[0].steps"));
        }
        // Joined to the model's directory later, an absolute path stays as it is.
        let absolute = absolute(data).map_err(|e| e.below("--data "))?;
        let measurement = self.experiment().measurement.clone();
        self.experiment_mut().measurement = measurement.with_path(absolute);
        Ok(())
    }

    /// Take the measurement from memory: points (x, y) and displacements (ux, uy) along the data's own axes, mm. The axes, the origin, the
    /// window and the rule on outliers are those of the model's measurement, whose file or directory is not read.
    ///
    /// # Errors
    /// The input's fault: arrays of different lengths, a number that is not finite, too few points, a load series.
    pub fn measured(mut self, points: &[[f64; 2]], displacements: &[[f64; 2]]) -> Result<Self> {
        self.refuse_series()?;
        let experiment = self.experiment();
        let field =
            experiment
                .measurement
                .of_arrays(points, displacements, experiment.window_mm)?;
        self.check_hole(&field)?;
        self.measured = Some(Arc::new(field));
        Ok(self)
    }

    /// The model's file with its measurement's absolute paths, so that it can be read from anywhere.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone. Of the program: a value that JSON cannot hold.
    pub fn resolved(&self) -> Result<serde_json::Value> {
        self.resolved_file()?.to_json()
    }

    /// The same as the types have it.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone.
    pub fn resolved_file(&self) -> Result<ModelFile> {
        let mut resolved = self.clone();
        *resolved.experiment_mut() = self.experiment().clone().below(self.base_dir())?;
        if let Some(supplied) = self.file.reduced_model.supplied() {
            let supplied = supplied.below(self.base_dir())?;
            resolved.file.reduced_model.snapshots = SnapshotsSpec::Supplied(supplied);
        }
        Ok(resolved.file)
    }

    /// Parse and validate the text of a model file at `path` in which one field stands, alone or among other experiments.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let outline = ModelOutline::read(text, &place)?;
        Self::field_of(&outline, outline.one_field(&place)?, path)
    }

    /// The field that an entry of a model file at `path` declares.
    ///
    /// # Errors
    /// The input's fault, with line or key.
    pub fn field_of(outline: &ModelOutline, entry: &ExperimentEntry, path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let (mut file, effects) = outline.field(entry)?;
        let base_dir = path.parent().unwrap_or(Path::new(""));
        let read = file.experiments[0].read_mesh(base_dir);
        read.map_err(|e| e.within(&place))?;
        let model = Self {
            file,
            path: path.to_path_buf(),
            effects,
            known: None,
            nominal: None,
            measured: None,
        };
        model.validate_scene().map_err(|e| e.within(&place))?;
        Ok(model)
    }

    /// Declared effects must be able to act, and a declared point must be one of the plate.
    fn validate_scene(&self) -> Result<()> {
        let scene = self.scene();
        for effect in &self.effects {
            if let Some(reason) = why_not(*effect, &scene) {
                let expected = format!("effects that can act, which this one cannot: {reason}");
                return Err(Error::input("effects", expected).found(effect.name()));
            }
        }
        check_gauge(
            self.experiment().gauge,
            &scene.frame,
            &*scene.setup.geometry,
        )
    }

    pub fn experiment(&self) -> &ExperimentSpec {
        &self.file.experiments[0]
    }

    /// The experiment, to change it.
    pub fn experiment_mut(&mut self) -> &mut ExperimentSpec {
        &mut self.file.experiments[0]
    }

    /// How the material's stiffness is parameterised.
    pub fn material(&self) -> Material {
        self.file.material.kind
    }

    /// The directory that relative paths of the model start from.
    pub fn base_dir(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The files of the measurement, of all its steps if it is a series, those of an imported mesh, and snapshots of another program; they
    /// are not read.
    ///
    /// # Errors
    /// Those of [`crate::field::MeasurementSpec::files`] and [`crate::reduce::SuppliedSpec::files`].
    pub fn measurement_files(&self) -> Result<Vec<PathBuf>> {
        let ExperimentSpec {
            measurement, steps, ..
        } = self.experiment();
        let mut files = self.experiment().mesh_files().to_vec();
        if let Some(supplied) = self.file.reduced_model.supplied() {
            files.extend(supplied.files(self.base_dir())?);
        }
        if self.measured.is_some() {
            return Ok(files);
        }
        let Some(steps) = steps else {
            files.extend(measurement.files(self.base_dir())?);
            return Ok(files);
        };
        for step in steps {
            let measurement = measurement.clone().with_path(step.file.clone());
            files.extend(measurement.files(self.base_dir())?);
        }
        Ok(files)
    }

    /// The hole that the model declares is where the points leave room for it.
    pub(super) fn check_hole(&self, field: &Field) -> Result<()> {
        match self.experiment().geometry().hole_radius() {
            Some(radius) => field
                .check_hole(radius)
                .map_err(|e| e.within(self.path.display())),
            None => Ok(()),
        }
    }

    /// Read the measured field and drop nothing but what the measurement's own rules drop.
    pub fn read_field(&self) -> Result<Field> {
        self.refuse_series()?;
        if let Some(field) = &self.measured {
            return Ok(Field::clone(field));
        }
        let experiment = self.experiment();
        let field = experiment
            .measurement
            .read(self.base_dir(), experiment.window_mm)?;
        self.check_hole(&field)?;
        Ok(field)
    }

    /// Marginal priors of the elastic constants, in their canonical order.
    pub fn marginals(&self) -> Vec<Marginal> {
        let constants = self.file.material.constants().into_iter();
        constants.map(|(_, prior)| prior).collect()
    }

    /// Prior means of the constants.
    pub(super) fn means(&self) -> Vec<f64> {
        self.marginals().iter().map(|m| m.mean).collect()
    }

    /// Names of the elastic constants.
    pub fn constants(&self) -> &'static [&'static str] {
        self.material().constants()
    }

    /// Standard deviation of the normal prior of parameter `k` of an effect, in its unit: the model's, or the
    /// dictionary's; `None` where nothing bounds it. That of the yield stress is what the material declares, if it does.
    pub fn prior_sd(&self, effect: &dyn Effect, k: usize) -> Option<f64> {
        let parameter = &effect.parameters()[k];
        let own = self
            .experiment()
            .plausible
            .get(&amplitude_name(effect, parameter));
        let yield_stress = self.file.material.yield_mpa;
        let declared = yield_stress.and_then(|stress| effect.prior_sd_by_yield_stress(k, stress));
        let unknown = effect.is_force_scale() && self.experiment().lacks_force();
        let unknown = unknown.then_some(UNKNOWN_FORCE_PERCENT);
        own.copied().or(unknown).or(declared).or(parameter.prior_sd)
    }

    /// Prior sd of an amplitude of a series of image correlation in a scene, border units.
    pub fn prior_sd_in_series(&self, scene: &Scene, effect: &dyn Effect, k: usize) -> f64 {
        let name = amplitude_name(effect, &effect.parameters()[k]);
        if let Some(own) = self.experiment().plausible.get(&name) {
            return *own;
        }
        effect
            .prior_sd_before_camera(k, scene)
            .or_else(|| self.prior_sd(effect, k))
            .unwrap_or(FREE_MM)
    }

    /// Whether every specimen has some of an effect: by its nature, or as `plausible` declares it of a manufacturing error.
    pub fn always_acts(&self, effect: &dyn Effect) -> bool {
        let declared = |name: String| self.experiment().plausible.contains_key(&name);
        let mut parameters = effect.parameters().iter();
        let is_declared =
            effect.is_manufacturing() && parameters.any(|p| declared(amplitude_name(effect, p)));
        is_declared || effect.always_acts()
    }

    /// What effects may need to know of the nominal test: the nominal constants, the mean thickness.
    pub fn scene(&self) -> Scene {
        let experiment = self.experiment();
        let frame = experiment.measurement.frame;
        let constants = self.nominal.clone().unwrap_or_else(|| self.means());
        let material = &self.file.material;
        let isotropic = material.kind == Material::Isotropic;
        let images = experiment.measurement.image_correlation;
        let setup = Setup {
            yield_stress: material.yield_mpa.map(|stress| stress.mean),
            geometry: experiment.geometry(),
            ..Setup::nominal(
                &experiment.specimen,
                &experiment.nominal_load(),
                frame.handedness(),
            )
            .with_regions(&experiment.stacks())
        };
        let assumed_mm = ASSUMED_WIDTHS * setup.width();
        Scene {
            frame,
            setup,
            ply: material.kind.ply(&constants),
            fringe_frequency_per_mm: experiment.measurement.fringe_frequency_per_mm,
            expansion_per_k: material
                .expansion_per_k
                .or((!isotropic).then_some(CARBON_EPOXY_EXPANSION)),
            material: material.kind,
            camera_distance_mm: images.map(|c| c.camera_distance_mm.unwrap_or(assumed_mm)),
            pixel_mm: images.and_then(|c| {
                c.pixel_mm
                    .or_else(|| experiment.measurement.mm_per_coordinate())
            }),
            subset_mm: images.map(|c| c.subset_mm),
            solved_elsewhere: self.file.reduced_model.supplied().is_some(),
            middle: [0.0; 2],
            declared_loads: experiment.declared_loads(),
        }
    }

    /// The subsets of the image correlation, where there is one.
    pub fn subsets(&self) -> Option<Subsets> {
        let images = self.experiment().measurement.image_correlation;
        images.map(Subsets::of)
    }

    /// The state in which everything has the values that `value` gives by name (`E1_GPa`, `load_misalignment.angle_deg`),
    /// border units; the prior's mean, or no amplitude, where it gives none.
    pub fn state(&self, value: &dyn Fn(&str) -> Option<f64>) -> State {
        let constants = self.constants().iter().zip(self.marginals());
        let constants: Vec<f64> = constants
            .map(|(name, prior)| value(name).unwrap_or(prior.mean))
            .collect();
        let acting = self.effects.iter().map(|effect| Acting {
            effect: *effect,
            amplitude: effect
                .parameters()
                .iter()
                .map(|p| value(&amplitude_name(*effect, p)).unwrap_or(0.0))
                .collect(),
        });
        let thickness = self.experiment().specimen.thickness_mm.mean;
        State::new(&constants, thickness).with(acting)
    }
}
