//! The specimen was warmer or colder when it was loaded.

use super::{Effect, EffectParameter, Entry, Kind, Scene, unless_same_expansion};
use crate::laminate::free_expansion;

pub struct ThermalStrain;

/// Prior sd of dT before a camera, K (prototype study).
const BEFORE_CAMERA_K: f64 = 5.0;

impl Effect for ThermalStrain {
    fn entry(&self) -> Entry {
        Entry {
            name: "thermal_strain",
            kind: Kind::Additive,
            parameters: const { &[EffectParameter::new("dT_K", 3.0, 300.0)] },
            about: "The specimen was warmer by dT when it was loaded than at the reference exposure, and expanded freely, as its plies' coefficients have it.",
            confirm: "Read a thermocouple on the specimen at both exposures; or compare two exposures at one and the same load, an hour apart.",
        }
    }

    fn prior_sd_before_camera(&self, _k: usize, _scene: &Scene) -> Option<f64> {
        Some(BEFORE_CAMERA_K)
    }

    /// u = eps (s, t), eps = A^-1 N_T for the nominal ply, about the hole's centre.
    fn displacement(&self, amplitude: &[f64], scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let Some(expansion) = scene.expansion_per_k else {
            return [0.0; 2];
        };
        let strain = free_expansion(&scene.ply, &scene.setup.angles, expansion) * amplitude[0];
        let shear = 0.5 * strain[2];
        [strain[0] * s + shear * t, shear * s + strain[1] * t]
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        unless_same_expansion(scene)
    }
}
