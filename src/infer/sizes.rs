//! How large effects may plausibly be in a series of image correlation.

use super::Model;
use crate::effect::{Effect, Scene, amplitude_name};
use crate::laminate::abd;

/// Prior sd of a motion in the plane, mm and, over the picture, rad: as good as none.
pub const FREE_MM: f64 = 10.0;

/// What image correlation may be expected to show of an effect, prior sds in border units in place of the dictionary's (prototype study);
/// of a motion towards the camera as a share of its distance.
const SEEN: &[(&str, f64)] = &[
    ("lens_distortion.percent_at_12mm", 0.072),
    ("thermal_strain.dT_K", 5.0),
    ("uniform_strain.exx_microstrain", 30.0),
    ("uniform_strain.eyy_microstrain", 30.0),
    ("uniform_strain.exy_microstrain", 30.0),
    // one lens for both components, and a sensor's pixels are square to less
    ("component_sensitivity.u1_percent", 0.1),
    ("component_sensitivity.u2_percent", 0.1),
];
const TOWARDS: f64 = 1.5e-4;

/// The strain of the face by bending over that far from the hole, and its relative change a mm along the load.
const BENT: f64 = 0.05;
const BENT_GRADIENT_PER_MM: f64 = 0.1;

/// Strain along the load far from the hole under the nominal force, by lamination theory.
fn far_strain(scene: &Scene) -> f64 {
    let setup = &scene.setup;
    let [_, [low, high]] = setup.geometry.extents();
    let compliance = abd(&scene.ply, &setup.angles, setup.thickness)
        .a
        .try_inverse();
    compliance.map_or(0.0, |c| c[(0, 0)] * setup.load.axial.abs() / (high - low))
}

impl Model {
    /// Prior sd of an amplitude of a series, border units.
    pub fn prior_sd_in_series(&self, effect: &dyn Effect, k: usize) -> f64 {
        self.prior_sd_pictured(&self.scene(), effect, k)
    }

    /// The same in a scene.
    pub fn prior_sd_pictured(&self, scene: &Scene, effect: &dyn Effect, k: usize) -> f64 {
        let name = amplitude_name(effect, &effect.parameters()[k]);
        if let Some(own) = self.experiment().plausible.get(&name) {
            return *own;
        }
        if effect.name() == "out_of_plane_translation" {
            let distance = scene.camera_distance_mm;
            return distance.map_or(1.0, |z| TOWARDS * z);
        }
        if effect.name() == "out_of_plane_bending" {
            let to_face_mm = 0.5 * scene.setup.thickness;
            let uniform_per_m = 1e3 * BENT * far_strain(scene) / to_face_mm;
            return [1.0, BENT_GRADIENT_PER_MM][k] * uniform_per_m;
        }
        let seen = SEEN.iter().find(|(n, _)| *n == name).map(|(_, sd)| *sd);
        seen.or_else(|| self.prior_sd(effect, k)).unwrap_or(FREE_MM)
    }
}
