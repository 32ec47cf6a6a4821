//! The model file: everything an analyst declares about a test.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::prior::{Marginal, PriorSpec};
use super::schema::{self, ModelFile};
use super::traced::TracedSeries;
use crate::effect::{
    Acting, Effect, Kind, LOAD_SCALE, Scene, YIELD_PERCENT, YIELDING, amplitude_name,
};
use crate::error::{Error, Result};
use crate::experiment::simulate::{FINER, HALF_WINDOW, Truth, simulate};
use crate::experiment::{
    Experiment, ExperimentKind, ExperimentSpec, FieldExperiment, FieldTest, Images, MockExperiment,
    State, Subsets, check_gauge,
};
use crate::fem::Setup;
use crate::field::rigid::{self, RigidMotion};
use crate::field::{Field, Grid, PartialSubsets, StepSpec, SubsetShape};
use crate::geometry;
use crate::laminate::{Material, MeanSd};
use crate::reduce::{Dimension, Problem, THICKNESS, exponents};

/// A validated model and where it came from.
#[derive(Clone)]
pub struct Model {
    pub file: ModelFile,
    pub path: PathBuf,
    /// Declared effects, in the order of the dictionary.
    pub effects: Vec<&'static dyn Effect>,
    /// What tracing found of the declared effects of a series: about that the next identification is linear in them.
    pub traced: Option<TracedSeries>,
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
        let (file, effects) = schema::parse(text, &place)?;
        let model = Self {
            file,
            path: path.to_path_buf(),
            effects,
            traced: None,
        };
        model.validate_scene().map_err(|e| e.within(&place))?;
        Ok(model)
    }

    /// Declared effects must be able to act, and a declared point must be one of the plate.
    fn validate_scene(&self) -> Result<()> {
        let scene = self.scene();
        for effect in &self.effects {
            if let Some(reason) = effect.obstacle(&scene) {
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

    /// The files of the measurement, of all its steps if it is a series; they are not read.
    ///
    /// # Errors
    /// Those of [`crate::field::MeasurementSpec::files`].
    pub fn measurement_files(&self) -> Result<Vec<PathBuf>> {
        let ExperimentSpec {
            measurement, steps, ..
        } = self.experiment();
        let Some(steps) = steps else {
            return measurement.files(self.base_dir());
        };
        let of_step = |step: &StepSpec| {
            let measurement = measurement.clone().with_path(step.file.clone());
            measurement.files(self.base_dir())
        };
        let files: Result<Vec<Vec<PathBuf>>> = steps.iter().map(of_step).collect();
        Ok(files?.concat())
    }

    /// The hole that the model declares is where the points leave room for it.
    pub(super) fn check_hole(&self, field: &Field) -> Result<()> {
        match geometry::declared(&self.experiment().specimen).hole_radius() {
            Some(radius) => field
                .check_hole(radius)
                .map_err(|e| e.within(self.path.display())),
            None => Ok(()),
        }
    }

    /// Read the measured field and drop nothing but what the measurement's own rules drop.
    pub fn read_field(&self) -> Result<Field> {
        self.refuse_series()?;
        let experiment = self.experiment();
        let field = experiment
            .measurement
            .read(self.base_dir(), experiment.window_mm)?;
        self.check_hole(&field)?;
        Ok(field)
    }

    /// Marginal priors of the elastic constants, in their canonical order.
    pub fn marginals(&self) -> Vec<Marginal> {
        self.constants()
            .iter()
            .map(|name| {
                let spec = &self.file.material.parameters[*name];
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
        self.material().constants()
    }

    /// Declared effects that need fields of their own, from the finite elements: mechanical and optical ones.
    pub fn sampled(&self) -> Vec<&'static dyn Effect> {
        self.effects
            .iter()
            .filter(|e| !matches!(e.kind(), Kind::Additive | Kind::Recorded))
            .filter(|e| !self.is_stepped(**e))
            .copied()
            .collect()
    }

    /// Declared effects that add a known field.
    pub fn additive(&self) -> Vec<&'static dyn Effect> {
        self.effects
            .iter()
            .filter(|e| e.kind() == Kind::Additive && !self.is_stepped(**e))
            .copied()
            .collect()
    }

    /// Standard deviation of the normal prior of parameter `k` of an effect, in its unit: the model's, or the
    /// dictionary's; `None` where nothing bounds it. That of the yield stress is what the material declares, if it does.
    pub fn prior_sd(&self, effect: &dyn Effect, k: usize) -> Option<f64> {
        let parameter = &effect.parameters()[k];
        let own = self
            .experiment()
            .plausible
            .get(&amplitude_name(effect, parameter));
        let declared = self.file.material.yield_mpa.filter(|stress| {
            stress.sd > 0.0 && effect.name() == YIELDING && parameter.name == YIELD_PERCENT
        });
        own.copied()
            .or(declared.map(|stress| 100.0 * stress.sd / stress.mean))
            .or(parameter.prior_sd)
    }

    /// The thickness with the load's uncertainty in its sd, mm: a field under a prescribed force depends on their ratio alone. Without the
    /// load where its scale is declared as an effect of its own.
    pub fn loaded_thickness_mm(&self) -> MeanSd {
        let MeanSd { mean, sd } = self.experiment().specimen.thickness_mm;
        let declared = self.effects.iter().any(|e| e.name() == LOAD_SCALE.name());
        let percent = self.prior_sd(LOAD_SCALE, 0).filter(|_| !declared);
        let load = mean * 0.01 * percent.unwrap_or(0.0);
        MeanSd {
            mean,
            sd: sd.hypot(load),
        }
    }

    /// What effects may need to know of the nominal test: prior means, mean thickness.
    pub fn scene(&self) -> Scene {
        let experiment = self.experiment();
        let frame = experiment.measurement.frame;
        let means: Vec<f64> = self.marginals().iter().map(|m| m.mean).collect();
        let material = &self.file.material;
        let isotropic = material.kind == Material::Isotropic;
        Scene {
            frame,
            setup: Setup {
                yield_stress: material.yield_mpa.map(|stress| stress.mean),
                ..Setup::nominal(
                    &experiment.specimen,
                    &experiment.nominal_load(),
                    frame.handedness(),
                )
            },
            ply: material.kind.ply(&means),
            fringe_frequency_per_mm: experiment.measurement.fringe_frequency_per_mm,
            expansion_per_k: material
                .expansion_per_k
                .or((!isotropic).then_some(CARBON_EPOXY_EXPANSION)),
            material: material.kind,
            camera_distance_mm: experiment
                .measurement
                .image_correlation
                .and_then(|c| c.camera_distance_mm),
            middle: [0.0; 2],
        }
    }

    /// The experiment seen over a window (low and high corner, (s, t) mm), ready to be predicted, on the model's mesh with
    /// its counts of elements multiplied by `finer`.
    ///
    /// # Errors
    /// A specimen that cannot be meshed.
    pub fn experiment_over(
        &self,
        window: [[f64; 2]; 2],
        finer: f64,
    ) -> Result<Arc<dyn Experiment>> {
        self.moved_experiment_over(window, RigidMotion::NONE, finer)
    }

    /// The same of a specimen that moves in the plane beside what the load does to it.
    fn moved_experiment_over(
        &self,
        window: [[f64; 2]; 2],
        motion: RigidMotion,
        finer: f64,
    ) -> Result<Arc<dyn Experiment>> {
        let [low, high] = window;
        let scene = Scene {
            middle: [0, 1].map(|k| 0.5 * (low[k] + high[k])),
            ..self.scene()
        };
        let spec = self.experiment();
        if spec.kind == ExperimentKind::Mock {
            return Ok(Arc::new(MockExperiment::new(scene, spec.gauge, window)));
        }
        let test = FieldTest {
            specimen: spec.specimen.clone(),
            load: spec.nominal_load(),
            frame: scene.frame,
            gauge: spec.gauge,
            fringe_frequency_per_mm: scene.fringe_frequency_per_mm,
            images: spec.measurement.image_correlation.map(|c| Images {
                subsets: Subsets {
                    side_mm: c.subset_mm,
                    shape: c.shape.unwrap_or(SubsetShape::Affine),
                    kept: c.partial_subsets == PartialSubsets::Kept,
                },
                camera_distance_mm: c.camera_distance_mm,
                motion,
            }),
            window,
            density: spec.density().scaled(finer),
            // a simulation asks for one field
            full_order: self.file.reduced_model.full_order || finer > 1.0,
        };
        Ok(Arc::new(FieldExperiment::new(test, scene)?))
    }

    /// Simulate a measurement of this model on a finer mesh, over a square about the hole that is nearly as wide as the plate.
    ///
    /// # Errors
    /// Those of [`simulate`].
    pub fn simulate(&self, truth: &Truth) -> Result<Grid> {
        self.refuse_series()?;
        let half = HALF_WINDOW * self.experiment().specimen.width_mm;
        let experiment = self.experiment_over([[-half; 2], [half; 2]], FINER)?;
        simulate(&*experiment, truth, half)
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

    /// The reduced model's problem for a measured field.
    ///
    /// # Errors
    /// Those of [`Problem::validate`]; a specimen that cannot be meshed.
    pub fn problem_of(&self, field: &Field) -> Result<Problem> {
        let imaged = self.experiment().measurement.image_correlation.is_some();
        let motion = if imaged {
            rigid::fit(&field.points, &field.displacement)
        } else {
            RigidMotion::NONE
        };
        self.problem_over(field.measured_bounds(), motion)
    }

    /// The same for a window of measured points, where nothing is known of how the specimen moves.
    ///
    /// # Errors
    /// Those of [`Model::problem_of`].
    pub fn problem(&self, window: [[f64; 2]; 2]) -> Result<Problem> {
        self.problem_over(window, RigidMotion::NONE)
    }

    fn problem_over(&self, window: [[f64; 2]; 2], motion: RigidMotion) -> Result<Problem> {
        let problem = Problem {
            experiment: self.moved_experiment_over(window, motion, 1.0)?,
            effects: self.sampled(),
            dimensions: self.dimensions()?,
            spec: self.file.reduced_model.clone(),
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
        let thickness = usize::from(self.experiment().specimen.thickness_mm.sd > 0.0);
        let reduced = &self.file.reduced_model;
        let variables = self.constants().len() + thickness + amplitudes;
        let wanted = 3 * exponents(variables, reduced.degree).len() / 2;
        self.file.reduced_model.snapshots = reduced.snapshots.max(wanted);
    }

    /// The DoE box: declared bounds, or [`Model::prior_box`], the thickness' mean +- 4 sd, and effects' amplitudes +- 3 prior sd.
    fn dimensions(&self) -> Result<Vec<Dimension>> {
        let mut dimensions = self.prior_box();
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
        let thickness = self.experiment().specimen.thickness_mm;
        if thickness.sd > 0.0 {
            dimensions.push(Dimension {
                name: THICKNESS.into(),
                low: thickness.mean - 4.0 * thickness.sd,
                high: thickness.mean + 4.0 * thickness.sd,
            });
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
