//! One experiment as a model file declares it: specimen, load, measurement, and the effects that may act in it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::gauge::Gauge;
use super::series::Law;
use crate::effect::{self, Effect};
use crate::error::{Error, Result};
use crate::field::spec::check_window;
use crate::field::{MeasurementSpec, StepSpec, step};
use crate::files::{absolute, unique};
use crate::geometry::{self, Density, Geometry};
use crate::laminate::{LoadSpec, Material, SpecimenSpec};
use crate::mesh_files::{ImportedPlate, MeshSpec, Part, RegionSpec};

/// An entry of `experiments`. Unknown keys are errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentSpec {
    /// Its name, which marks the parameters that are its own.
    pub name: String,
    /// What was observed.
    pub kind: ExperimentKind,
    pub specimen: SpecimenSpec,
    /// An imported mesh in place of the strip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshSpec>,
    /// The shape that this mesh makes, once it was read.
    #[serde(skip)]
    pub meshed: Option<Arc<ImportedPlate>>,
    /// The load of the one measurement; the steps of a series have their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load: Option<LoadSpec>,
    /// How the rigid motion of predictions is fixed.
    #[serde(default)]
    pub gauge: Gauge,
    pub measurement: MeasurementSpec,
    /// A series of loads in place of one, in the order in which they were taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<Vec<StepSpec>>,
    /// Sd of the error that every declared force of a series has in its own step, percent of it; that of a machine of class 1 where
    /// nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_sd_percent: Option<f64>,
    /// The force of the reference step, N, as the size of its field has it: of a series of which no force is known.
    #[serde(skip)]
    pub fitted_n: Option<f64>,
    /// Restriction of the points used, `[[x0, y0], [x1, y1]]` in the data's frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_mm: Option<[[f64; 2]; 2]>,
    /// Effects that the model declares.
    pub effects: Vec<String>,
    /// How the amplitudes of declared motions go over the steps of a series; in proportion to the force where nothing is said.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub laws: BTreeMap<String, Law>,
    /// What measured the forces; fields of a file that do not say so share one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub load_cell: String,
    /// Effects that tracing may consider, in place of the whole dictionary.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<Vec<String>>,
    /// Standard deviations of effects' amplitudes by `effect.parameter`, in its unit, in place of the dictionary's.
    #[serde(
        default,
        deserialize_with = "unique",
        skip_serializing_if = "BTreeMap::is_empty"
    )]
    pub plausible: BTreeMap<String, f64>,
    /// Factor on the numbers of elements along each direction of the default mesh.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub mesh_density: f64,
}

/// What is known of the forces of a series beside what each step declares.
#[derive(Debug, Clone, Copy)]
pub struct StepForces {
    /// The force that all others are stated over, N.
    pub nominal_n: f64,
    /// Sd of the error of a declared force in its own step, percent of it.
    pub sd_percent: f64,
}

/// What an experiment observes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", try_from = "String")]
pub enum ExperimentKind {
    /// The displacement field of a plate under one load.
    Field,
    /// A field in closed form ([`super::MockExperiment`]), for tests of everything that is not physics.
    Mock,
}

impl TryFrom<String> for ExperimentKind {
    type Error = String;

    fn try_from(name: String) -> std::result::Result<Self, String> {
        match name.as_str() {
            "field" => Ok(Self::Field),
            "mock" => Ok(Self::Mock),
            _ => Err(format!(
                "\"{name}\", expected \"field\": this version cannot predict another kind of experiment yet"
            )),
        }
    }
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

/// Smallest and largest `mesh_density`: below, the hole's edge is a polygon; above, a solution takes minutes.
const DENSITIES: [f64; 2] = [0.1, 4.0];

/// A name that may stand in a file's or a parameter's name.
///
/// # Errors
/// The input's fault, at `name`.
pub fn check_name(name: &str, purpose: &str) -> Result<()> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if !name.is_empty() && !name.starts_with('.') && name.chars().all(plain) {
        return Ok(());
    }
    let expected = format!("letters, digits, '-', '_' and '.', because it names {purpose}");
    Err(Error::input("name", expected).found(name))
}

impl ExperimentSpec {
    /// Check everything that the types cannot, and resolve the declared effects, which are returned in the order of the
    /// dictionary.
    ///
    /// # Errors
    /// The input's fault; the place is the key within this experiment.
    pub fn validate(&self, material: Material) -> Result<Vec<&'static dyn Effect>> {
        check_name(&self.name, "the experiment's own parameters")?;
        self.specimen.validate(material, self.mesh.is_some())?;
        if let Some(mesh) = &self.mesh {
            mesh.validate()?;
            mesh.validate_material(material)?;
            if self.kind == ExperimentKind::Mock && !mesh.regions.is_empty() {
                let expected = "no regions, because a mock is one uniform sheet";
                return Err(Error::input("mesh.regions", expected).found("some"));
            }
        }
        self.validate_load()?;
        check_window(self.window_mm)?;
        let [low, high] = DENSITIES;
        if !(low..=high).contains(&self.mesh_density) {
            let expected =
                format!("a factor from {low} to {high} on the mesh's numbers of elements");
            return Err(Error::input("mesh_density", expected).found(self.mesh_density));
        }
        self.validate_plausible()?;
        for name in self.candidates.iter().flatten() {
            effect::find("candidates", name)?;
        }
        for (k, name) in self.effects.iter().enumerate() {
            effect::find("effects", name)?;
            if self.effects[..k].contains(name) {
                return Err(Error::input("effects", "every effect at most once").found(name));
            }
        }
        Ok(effect::EFFECTS
            .iter()
            .filter(|e| self.effects.iter().any(|name| name == e.name()))
            .copied()
            .collect())
    }

    /// Declare what acts because a loaded edge of the mesh is to be measured.
    pub fn declare_introductions(&mut self) {
        let measured = self.mesh.as_ref().map_or(0, MeshSpec::measured);
        for effect in effect::load_introductions(measured) {
            if !self
                .effects
                .iter()
                .any(|declared| declared == effect.name())
            {
                self.effects.push(effect.name().into());
            }
        }
    }

    /// Either one load and one measurement, or steps that have their own.
    fn validate_load(&self) -> Result<()> {
        let path = &self.measurement.source.path;
        if let Some(percent) = self.force_sd_percent {
            if self.steps.is_none() {
                let expected = "no such key, because one load has no other to differ from";
                return Err(Error::input("force_sd_percent", expected)
                    .found(percent)
                    .hint(format!(
                        "the sd of the machine's scale is plausible: {{\"{}.percent\": ...}}",
                        effect::force_scale().name()
                    )));
            }
            step::check_sd(percent)?;
        }
        match (&self.steps, &self.load) {
            (None, Some(load)) if path.is_some() => load.validate(),
            (None, Some(_)) => Err(self.measurement.without_path().below("measurement.")),
            (None, None) => Err(Error::input(
                "load",
                "the load of the measurement, {\"force_N\": ...}, or steps",
            )
            .found("no such key")),
            (Some(_), Some(_)) => Err(Error::input(
                "load",
                "no such key, because each of the steps has its own force",
            )
            .found("a load")),
            (Some(steps), None) => match path {
                Some(path) => Err(Error::input(
                    "measurement",
                    "no file and no directory, because each of the steps has its own",
                )
                .found(path.display())),
                None => step::check(steps),
            },
        }
    }

    /// The load to which predictions belong: the declared one, or that of the largest known force of the steps.
    pub fn nominal_load(&self) -> LoadSpec {
        let of_steps = || step::nominal_n(self.steps.as_deref().unwrap_or_default());
        self.load.unwrap_or_else(|| LoadSpec {
            force_n: self.fitted_n.unwrap_or_else(of_steps),
        })
    }

    /// Declared force of every step of a series over the nominal one; none of one load.
    pub fn declared_loads(&self) -> Vec<Option<f64>> {
        let nominal_n = self.nominal_load().force_n;
        let steps = self.steps.iter().flatten();
        steps.map(|s| s.force_n.map(|f| f / nominal_n)).collect()
    }

    /// How well the forces of a series are known.
    pub fn forces(&self) -> StepForces {
        StepForces {
            nominal_n: self.nominal_load().force_n,
            sd_percent: self.force_sd_percent.unwrap_or(step::CLASS_1_SD_PERCENT),
        }
    }

    /// Whether this is a series of which no force is known.
    pub fn lacks_force(&self) -> bool {
        let steps = self.steps.as_deref();
        steps.is_some_and(|steps| steps.iter().all(|s| s.force_n.is_none_or(|f| f == 0.0)))
    }

    /// The same experiment with absolute paths: `base_dir` is where relative ones start.
    ///
    /// # Errors
    /// Of the input: a current directory that is gone.
    pub fn below(mut self, base_dir: &Path) -> Result<Self> {
        self.measurement = self.measurement.below(base_dir)?;
        for step in self.steps.iter_mut().flatten() {
            step.file = absolute(&base_dir.join(&step.file))?;
        }
        if let Some(mesh) = &mut self.mesh {
            mesh.file = absolute(&base_dir.join(&mesh.file))?;
        }
        Ok(self)
    }

    /// Read the imported mesh, if there is one; `base_dir` is where a relative path starts.
    ///
    /// # Errors
    /// Those of [`Part::read`].
    pub fn read_mesh(&mut self, base_dir: &Path) -> Result<()> {
        if let Some(mesh) = &self.mesh {
            let part = Part::read(mesh.clone().below(base_dir))?;
            let frame = self.measurement.frame;
            let plate = ImportedPlate::new(part, &|v| frame.vector(v));
            self.meshed = Some(Arc::new(plate));
        }
        Ok(())
    }

    /// The files of the imported mesh, none where there is none.
    pub fn mesh_files(&self) -> &[PathBuf] {
        self.meshed
            .as_ref()
            .map_or(&[], |plate| plate.part().files())
    }

    /// The point of the imported mesh that the data's frame begins at, mm; none without one.
    pub fn mesh_origin_mm(&self) -> Option<[f64; 2]> {
        self.meshed.as_ref().map(|plate| plate.part().origin())
    }

    /// The stacks of regions of the imported mesh, none without one.
    pub fn stacks(&self) -> Vec<RegionSpec> {
        self.mesh.as_ref().map_or_else(Vec::new, MeshSpec::stacks)
    }

    /// The specimen's shape in the frame of its measurement.
    pub fn geometry(&self) -> Arc<dyn Geometry> {
        match &self.meshed {
            Some(plate) => plate.clone(),
            None => geometry::declared(&self.specimen),
        }
    }

    /// Every name is that of an effect's parameter, and every size can be a standard deviation.
    fn validate_plausible(&self) -> Result<()> {
        let known: Vec<String> = effect::EFFECTS
            .iter()
            .flat_map(|e| e.parameters().iter().map(|p| effect::amplitude_name(*e, p)))
            .collect();
        for (name, &sd) in &self.plausible {
            if !known.contains(name) {
                let expected = format!("one of {}", known.join(", "));
                return Err(Error::input("plausible", expected).found(name));
            }
            // of what acts in every test 0 is "known exactly"
            let may_vanish = effect::EFFECTS.iter().any(|e| {
                e.is_of_every_test() && name == &effect::amplitude_name(*e, &e.parameters()[0])
            });
            if !(sd.is_finite() && (sd > 0.0 || (may_vanish && sd == 0.0))) {
                return Err(Error::input(
                    format!("plausible.{name}"),
                    "a finite standard deviation above 0, in the parameter's unit",
                )
                .found(sd));
            }
        }
        Ok(())
    }

    /// The mesh of predictions.
    pub fn density(&self) -> Density {
        Density::DEFAULT.scaled(self.mesh_density)
    }
}
