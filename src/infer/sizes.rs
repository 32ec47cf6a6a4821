//! How large effects may plausibly be in a series of image correlation.

use super::Model;
use crate::effect::{Effect, Scene, amplitude_name};

/// Prior sd of a motion in the plane, mm and, over the picture, rad: as good as none.
pub const FREE_MM: f64 = 10.0;

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
        effect
            .prior_sd_before_camera(k, scene)
            .or_else(|| self.prior_sd(effect, k))
            .unwrap_or(FREE_MM)
    }
}
