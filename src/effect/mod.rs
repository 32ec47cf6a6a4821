//! The dictionary of physical effects: what each does to the test, to the observation, or to both.
//!
//! A new effect is one new file here and one line in [`EFFECTS`].

mod anisotropy;
mod balanced_misorientation;
mod camera_rotation;
mod camera_tilt;
mod component_sensitivity;
mod fibre_nonlinearity;
mod force_offset;
mod forces;
mod fringe_order_jump;
mod hole_edge_damage;
mod hole_offset;
mod hole_size;
mod hysteresis;
mod in_plane_bending;
mod interpolation_bias;
mod lens_distortion;
pub mod limit;
mod load_introduction;
mod load_misalignment;
mod load_scale;
mod magnification;
mod optics;
mod out_of_plane_bending;
mod out_of_plane_rotation;
mod out_of_plane_translation;
mod parameter;
mod phase_shift_error;
mod ply_misorientation;
mod ply_share;
mod registration_offset;
mod residual_load;
mod rigid_rotation;
mod rigid_translation;
mod seen;
mod shear_nonlinearity;
mod single_ply_misorientation;
mod softening;
mod step_force;
mod subset_size;
mod thermal_gradient;
mod thermal_strain;
mod thickness_taper;
mod uniform_strain;
mod width_error;
mod yielding;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::{Error, Result};
use crate::fem::Setup;
use crate::field::Frame;
use crate::laminate::{Material, MeanSd, Ply};

pub use optics::displacements_are_imaged;
pub use parameter::{EffectParameter, amplitude_name};
pub use seen::Seen;

use parameter::check_amplitude;

/// Every known effect, in the order in which they are listed.
pub static EFFECTS: &[&dyn Effect] = &[
    &rigid_translation::RigidTranslation,
    &rigid_rotation::RigidRotation,
    &uniform_strain::UniformStrain,
    &thermal_strain::ThermalStrain,
    &thermal_gradient::ThermalGradient,
    &registration_offset::RegistrationOffset,
    &camera_rotation::CameraRotation,
    &magnification::Magnification,
    &camera_tilt::CameraTilt,
    &lens_distortion::LensDistortion,
    &component_sensitivity::ComponentSensitivity,
    &out_of_plane_translation::OutOfPlaneTranslation,
    &out_of_plane_rotation::OutOfPlaneRotation,
    &interpolation_bias::InterpolationBias,
    &subset_size::SubsetSize,
    &phase_shift_error::PhaseShiftError,
    &fringe_order_jump::FringeOrderJump,
    &load_introduction::LoadIntroduction(0),
    &load_introduction::LoadIntroduction(1),
    &load_misalignment::LoadMisalignment,
    &in_plane_bending::InPlaneBending,
    &out_of_plane_bending::OutOfPlaneBending,
    &hole_offset::HoleOffset,
    &hole_size::HoleSize,
    &ply_misorientation::PlyMisorientation,
    &single_ply_misorientation::SinglePlyMisorientation(0),
    &single_ply_misorientation::SinglePlyMisorientation(1),
    &single_ply_misorientation::SinglePlyMisorientation(2),
    &balanced_misorientation::BalancedMisorientation,
    &ply_share::PlyShare(0),
    &ply_share::PlyShare(1),
    &thickness_taper::ThicknessTaper,
    &hole_edge_damage::HoleEdgeDamage,
    &shear_nonlinearity::ShearNonlinearity,
    &fibre_nonlinearity::FibreNonlinearity,
    &yielding::Yielding,
    &anisotropy::Anisotropy,
    &load_scale::LoadScale,
    &width_error::WidthError,
    &force_offset::ForceOffset,
    &residual_load::ResidualLoad,
    &softening::SofteningWithLoad,
    &hysteresis::Hysteresis,
    &step_force::StepForce(0),
    &step_force::StepForce(1),
    &step_force::StepForce(2),
    &step_force::StepForce(3),
    &step_force::StepForce(4),
    &step_force::StepForce(5),
    &step_force::StepForce(6),
    &step_force::StepForce(7),
    &step_force::StepForce(8),
    &step_force::StepForce(9),
    &step_force::StepForce(10),
    &step_force::StepForce(11),
];

/// The effect that scales all forces.
pub fn force_scale() -> &'static dyn Effect {
    &load_scale::LoadScale
}

/// The effect that makes the plate wider.
pub fn width_error() -> &'static dyn Effect {
    &width_error::WidthError
}

/// The effect that the recording of fringes has by some `error`.
pub fn of_recording(error: RecordingError) -> &'static dyn Effect {
    match error {
        RecordingError::MiscountedOrders => &fringe_order_jump::FringeOrderJump,
        RecordingError::PhaseRipple => &phase_shift_error::PhaseShiftError,
    }
}

/// Effects that tell how the force is spread over the first `count` loaded edges that a measurement has to tell.
pub fn load_introductions(count: usize) -> impl Iterator<Item = &'static dyn Effect> {
    let of_edge = move |effect: &&&dyn Effect| effect.measured_edge().is_some_and(|k| k < count);
    EFFECTS.iter().filter(of_edge).copied()
}

/// The obstacle of an effect that acts on fringes.
fn unless_fringes(scene: &Scene) -> Option<&'static str> {
    let text =
        "displacements are not read from fringes: measurement.fringe_frequency_per_mm is not given";
    scene.fringe_frequency_per_mm.is_none().then_some(text)
}

/// The obstacle of an effect that bends or turns the specimen in its plane, where stiff grips load it.
fn unless_moments(scene: &Scene) -> Option<&'static str> {
    (!scene.setup.geometry.yields_to_moments())
        .then_some("stiff grips guide all loaded edges, which can neither turn nor lean")
}

/// The obstacle of an expansion in closed form, for plies of the same directions everywhere.
fn unless_same_expansion(scene: &Scene) -> Option<&'static str> {
    if scene.expansion_per_k.is_none() {
        return Some("the material's thermal expansion is unknown: give expansion_per_K");
    }
    (scene.setup.has_own_plies())
        .then_some("regions of the mesh have plies of other directions (mesh.regions): they expand differently, and hold each other")
}

/// The obstacle of an effect of the specimen's own plies.
fn unless_own_plies(scene: &Scene) -> Option<&'static str> {
    if scene.material == Material::Isotropic {
        return Some("an isotropic plate has no plies");
    }
    let has_own = scene.setup.regions.iter().any(|r| r.layup.is_some());
    has_own.then_some(
        "regions of the mesh have a layup of their own (mesh.regions), without the specimen's plies",
    )
}

/// The obstacle of an effect that changes the hole, where the geometry does not offer it.
fn unless_movable(scene: &Scene) -> Option<&'static str> {
    let geometry = &scene.setup.geometry;
    if geometry.has_movable_hole() {
        return None;
    }
    if !scene.setup.regions.is_empty() && geometry.hole_radius().is_some() {
        return Some("regions of the mesh meet at the hole or near it, and would move with it");
    }
    Some("the specimen's geometry has no hole that could be changed so")
}

/// How an effect acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A displacement field that is known beforehand is added to what is observed, in proportion to the amplitudes.
    Additive,
    /// The field is seen at other points, or along other axes, than those reported.
    Optical,
    /// The instrument records something else than the displacement that it sees.
    Recorded,
    /// The test itself is another one: the finite elements are solved anew.
    Mechanical,
    /// The field is averaged over other subsets than the declared ones.
    Averaged,
    /// In some steps of a series the whole field is that of another force than the declared one.
    Load,
}

impl Kind {
    pub fn words(self) -> &'static str {
        match self {
            Kind::Additive => "a displacement field that is added",
            Kind::Optical => "the field seen at other points or along other axes",
            Kind::Recorded => "what the instrument records of the displacement",
            Kind::Mechanical => "another test, solved by finite elements",
            Kind::Averaged => "the field averaged over other subsets",
            Kind::Load => "the whole field of a step, as of another force",
        }
    }
}

/// What an effect's amplitude has to do with the steps of a load series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scope {
    /// It belongs to the specimen or the load; its field grows with the force.
    Mechanical,
    /// It belongs to the static picture, and acts through the whole motion of the specimen.
    Picture,
    /// It is another in each step, by some law.
    Motion,
    /// It belongs to the recording.
    Recording,
    /// It is a multiple of the whole field that the load causes, by a pattern of its own over the steps.
    Force,
}

/// What goes wrong where fringes are recorded. Both are taken out of the field before it is fitted.
#[derive(Debug, Clone, Copy)]
pub enum RecordingError {
    /// Whole fringe orders, in a region.
    MiscountedOrders,
    /// A ripple at twice the fringe frequency.
    PhaseRipple,
}

/// Places that nobody knows and on which an effect's field depends. Their products with its amplitudes have columns of their own.
#[derive(Clone, Copy)]
pub enum Companions {
    None,
    /// The centre about which it acts: its parameters after the first, which is its strength. Without strength the centre does not matter.
    Centre,
    /// The camera's axis, and the pivot about which the specimen turns; a pivot off the origin lifts the specimen by the effect `lift`.
    AxisAndPivot {
        lift: &'static dyn Effect,
    },
    /// The camera's axis, and how far the effect `lift` moves the specimen as a whole towards the camera.
    AxisAndLift {
        lift: &'static dyn Effect,
    },
}

/// What an effect may need to know of the nominal test.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The data's frame.
    pub frame: Frame,
    pub setup: Setup,
    /// The ply at the nominal constants.
    pub ply: Ply,
    /// Frequency of the fringes a mm of displacement, where displacements are read from fringes.
    pub fringe_frequency_per_mm: Option<f64>,
    /// Thermal expansion of a ply along and across its fibres, 1/K, where it is known.
    pub expansion_per_k: Option<[f64; 2]>,
    /// How the stiffness is parameterised.
    pub material: Material,
    /// Distance of the camera from the specimen, mm, where images are correlated; assumed where it is not declared.
    pub camera_distance_mm: Option<f64>,
    /// Size of a pixel on the specimen, mm, where images are correlated and it is declared.
    pub pixel_mm: Option<f64>,
    /// Side of the declared subset, mm, where images are correlated.
    pub subset_mm: Option<f64>,
    /// Whether another program solved the fields, so that only what is added to them or done to their picture can be predicted.
    pub solved_elsewhere: bool,
    /// Middle of the picture, (s, t) mm: the camera's axis and the centre of its lens are near it.
    pub middle: [f64; 2],
    /// Declared force of every step of a series over the nominal one, none of a step whose force is not known; empty of one load.
    pub declared_loads: Vec<Option<f64>>,
}

/// An effect in the dictionary.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Canonical name.
    pub name: &'static str,
    /// How it acts.
    pub kind: Kind,
    /// Its parameters. Amplitudes are given in this order, in border units.
    pub parameters: &'static [EffectParameter],
    /// What it is, in a sentence.
    pub about: &'static str,
    /// What experiment would confirm it.
    pub confirm: &'static str,
}

/// A physical effect that a model may lack. Points are (s, t) and displacements (u1, u2), both in mm, in the model's
/// frame (origin at the hole's centre, direction 1 along the load).
pub trait Effect: Sync {
    /// What it is called, what is known of it beforehand, and what is said of it.
    fn entry(&self) -> Entry;

    fn name(&self) -> &'static str {
        self.entry().name
    }

    fn parameters(&self) -> &'static [EffectParameter] {
        self.entry().parameters
    }

    fn kind(&self) -> Kind {
        self.entry().kind
    }

    /// Weights of its two amplitudes (border units) whose sum cannot be negative, where the first cannot either.
    fn never_negative(&self) -> Option<[f64; 2]> {
        None
    }

    /// A mechanical effect's change to the test.
    fn alter(&self, _amplitude: &[f64], _setup: &mut Setup) {}

    /// An additive effect's displacement at a point, in closed form.
    fn displacement(&self, _amplitude: &[f64], _scene: &Scene, _point: [f64; 2]) -> [f64; 2] {
        [0.0; 2]
    }

    /// The curvature along the load, `[0]` + `[1]` s (1/mm, 1/mm^2), of an additive effect that bends the specimen out of its plane. Its
    /// [`Effect::displacement`] is that of a plate without a hole: an experiment with a mesh knows better.
    fn curvature(&self, _amplitude: &[f64]) -> Option<[f64; 2]> {
        None
    }

    /// The true point that an optical effect reports as `reported`.
    fn true_point(&self, _amplitude: &[f64], _scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        reported
    }

    /// How many of its parameters, the first ones, must be given where its amplitudes are.
    fn needed(&self) -> usize {
        self.parameters().len()
    }

    /// How far an optical effect that moves the specimen moves a point of it, mm: along both directions and, last, out of the plane
    /// towards the camera. The point is where the load and the motion in the plane have brought it.
    fn motion(&self, _amplitude: &[f64], _scene: &Scene, _point: [f64; 2]) -> [f64; 3] {
        [0.0; 3]
    }

    /// What an optical effect makes of the displacement `u` that is read at the reported point; of image coordinates, beside the
    /// map of the picture.
    fn components(
        &self,
        _amplitude: &[f64],
        _scene: &Scene,
        _reported: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        u
    }

    /// What an amplitude of 1 adds where the displacement is exported as `_exported` (mm, model's axes, rigid motion included), of an effect
    /// that acts through that; it is in proportion to its only amplitude. None of all others.
    fn exported(&self, _scene: &Scene, _exported: [f64; 2]) -> Option<[f64; 2]> {
        None
    }

    /// What the instrument records of the displacement `u` (rigid motion included) at a point.
    fn recorded(
        &self,
        _amplitude: &[f64],
        _scene: &Scene,
        _point: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        u
    }

    /// What an effect's amplitude has to do with the steps of a load series.
    fn scope(&self) -> Scope {
        match self.kind() {
            Kind::Mechanical | Kind::Averaged => Scope::Mechanical,
            Kind::Optical => Scope::Picture,
            Kind::Additive => Scope::Motion,
            Kind::Recorded => Scope::Recording,
            Kind::Load => Scope::Force,
        }
    }

    /// Of an effect of [`Scope::Force`] its share in each step, where forces are `loads` over the largest.
    fn over_steps(&self, loads: &[f64]) -> Vec<f64> {
        vec![0.0; loads.len()]
    }

    /// By how much it raises the force of a step in which its share is 1, over the nominal force.
    fn force(&self, amplitude: &[f64], _scene: &Scene) -> f64 {
        0.01 * amplitude[0]
    }

    /// Whether the test has what it speaks of: a series without a seventh step has no force of that step.
    fn applies_to(&self, scene: &Scene) -> bool {
        self.scope() != Scope::Force || self.why_not(scene).is_none()
    }

    /// By how much more than a declared subset does it displacements are averaged, over what that does to them: for a shape function whose
    /// error goes with this power of the subset's side.
    fn smoothing(&self, _amplitude: &[f64], _power: i32) -> f64 {
        0.0
    }

    /// What amplitudes with means and sds mean for who reads the constants or the fields, in a sentence; none where they speak for
    /// themselves.
    fn meaning(&self, _amplitude: &[[f64; 2]], _scene: &Scene) -> Option<String> {
        None
    }

    /// Whether what a mechanical effect has added under a force is still there when the force has gone.
    fn remains(&self) -> bool {
        false
    }

    /// Whether a field under a prescribed force stays 1 / (h E1) times a function of the moduli's ratios where this acts.
    fn scales(&self) -> bool {
        true
    }

    /// Whether it moves the specimen as a whole in its plane. Every step of a load series does so by its own amount.
    fn is_rigid(&self) -> bool {
        false
    }

    /// Whether it is a scatter of the making that every specimen has: where `plausible` declares how much, it widens the quoted constants
    /// however little the data ask for.
    fn is_manufacturing(&self) -> bool {
        false
    }

    /// Whether it is weighed only where `plausible` declares how much of it specimens have.
    fn needs_declared_scatter(&self) -> bool {
        false
    }

    /// Whether a field tells it from a common factor of all moduli hardly or not at all: it takes part in every model with its prior.
    fn is_of_every_test(&self) -> bool {
        false
    }

    /// Whether it scales all forces, and does nothing else.
    fn is_force_scale(&self) -> bool {
        false
    }

    /// Whether metal yields by it where the stress is high.
    fn yields(&self) -> bool {
        false
    }

    /// Which of the loaded edges that a measurement has to tell it spreads the force over, counted from 0.
    fn measured_edge(&self) -> Option<usize> {
        None
    }

    /// Places that nobody knows and on which its field depends.
    fn companions(&self) -> Companions {
        Companions::None
    }

    /// Whether parameter `k` is of a centre, which does not matter where the effect has no strength.
    fn is_centre(&self, k: usize) -> bool {
        k > 0 && matches!(self.companions(), Companions::Centre)
    }

    /// Prior sd of the amplitude of parameter `k` before a camera, where images are correlated in a load series; `None` where it is that of
    /// [`EffectParameter::prior_sd`].
    fn prior_sd_before_camera(&self, _k: usize, _scene: &Scene) -> Option<f64> {
        None
    }

    /// Prior sd of the amplitude of parameter `k` that follows from the declared yield stress; `None` where none does.
    fn prior_sd_by_yield_stress(&self, _k: usize, _declared: MeanSd) -> Option<f64> {
        None
    }

    /// The effect that stands for what a single field does not tell of the places in [`Effect::companions`].
    fn entails(&self) -> Option<&'static dyn Effect> {
        None
    }

    /// Prior sd of the entailed effect, in its unit, for this effect's amplitudes before a camera at some distance (mm), where the unknown
    /// places are about `off_mm` from where they are taken to be.
    fn entailed_sd(&self, _amplitude: &[f64], _off_mm: f64, _distance_mm: f64) -> f64 {
        0.0
    }

    /// What amplitudes within the parameters' bounds should have been, where these cannot be.
    fn inadmissible(&self, _amplitude: &[f64]) -> Option<&'static str> {
        None
    }

    /// Whether every specimen has some of it: where it is not found it acts with its prior sd all the same.
    fn always_acts(&self) -> bool {
        false
    }

    /// Why the effect cannot act in this test; nothing if it can.
    fn why_not(&self, _scene: &Scene) -> Option<&'static str> {
        None
    }
}

/// Why an effect cannot act in a test; nothing if it can.
pub fn why_not(effect: &dyn Effect, scene: &Scene) -> Option<&'static str> {
    let needs_a_solution = matches!(effect.kind(), Kind::Mechanical | Kind::Averaged);
    if scene.solved_elsewhere && needs_a_solution && !effect.is_force_scale() {
        return Some("the snapshots are another program's, which would have to solve it");
    }
    effect.why_not(scene)
}

/// The effect of a name; `place` names the key or argument for the error, which lists the known names.
pub fn find(place: &str, name: &str) -> Result<&'static dyn Effect> {
    EFFECTS
        .iter()
        .find(|effect| effect.name() == name)
        .copied()
        .ok_or_else(|| {
            let known: Vec<_> = EFFECTS.iter().map(|effect| effect.name()).collect();
            Error::input(place, format!("one of {}", known.join(", "))).found(name)
        })
}

/// An effect with its amplitudes, one a parameter, in border units.
#[derive(Clone, Serialize, Deserialize)]
pub struct Acting {
    pub effect: &'static dyn Effect,
    pub amplitude: Vec<f64>,
}

/// By its name.
impl Serialize for dyn Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        self.name().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for &'static dyn Effect {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        find("effect", &String::deserialize(from)?).map_err(serde::de::Error::custom)
    }
}

impl Acting {
    /// Parse `NAME=VALUE` or `NAME=VALUE,VALUE`, in the units of the effect's parameters; those that an effect can do without may be left out,
    /// which makes them 0.
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        let (name, values) = text
            .split_once('=')
            .ok_or_else(|| Error::input(place, "NAME=VALUE").found(text))?;
        let effect = find(place, name.trim())?;
        let parameters = effect.parameters();
        let wanted: Vec<_> = parameters.iter().map(|p| p.name).collect();
        let place = format!("{place} {name}");
        let mut amplitude = values
            .split(',')
            .map(|value| {
                value
                    .trim()
                    .parse()
                    .map_err(|_| Error::input(&place, "a number").found(value))
            })
            .collect::<Result<Vec<f64>>>()?;
        if !(effect.needed()..=parameters.len()).contains(&amplitude.len()) {
            return Err(Error::input(
                &place,
                format!("{} value(s): {}", wanted.len(), wanted.join(",")),
            )
            .found(values));
        }
        amplitude.resize(parameters.len(), 0.0);
        for (value, parameter) in amplitude.iter().zip(parameters) {
            check_amplitude(&place, parameter, *value)?;
        }
        if let Some(expected) = effect.inadmissible(&amplitude) {
            return Err(Error::input(&place, expected).found(values));
        }
        Ok(Self { effect, amplitude })
    }
}

/// Amplitudes of an effect: one border unit of its parameter `k`, and nothing of the others.
pub fn one_unit(effect: &dyn Effect, k: usize) -> Vec<f64> {
    let mut unit = vec![0.0; effect.parameters().len()];
    unit[k] = 1.0;
    unit
}

/// Fields of one border unit of a recorded effect's parameter `k` at points (s, t), mm, for the displacement `smooth`
/// (mm, translation included) that the instrument saw there. The measured displacement itself will not do for it: its
/// noise would be in the argument of the ripple, and take from the amplitude.
pub fn recorded_column(
    effect: &dyn Effect,
    k: usize,
    scene: &Scene,
    points: &[[f64; 2]],
    smooth: &[[f64; 2]],
) -> Vec<[f64; 2]> {
    let unit = one_unit(effect, k);
    points
        .iter()
        .zip(smooth)
        .map(|(&p, &u)| {
            let recorded = effect.recorded(&unit, scene, p, u);
            [recorded[0] - u[0], recorded[1] - u[1]]
        })
        .collect()
}
