//! The instrument scales the two components of the displacement.

use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct ComponentSensitivity;

/// Prior sd before a camera: one lens pictures both components, and a sensor's pixels are square to less.
const BEFORE_CAMERA_PERCENT: f64 = 0.1;

impl Effect for ComponentSensitivity {
    fn entry(&self) -> Entry {
        Entry {
            name: "component_sensitivity",
            kind: Kind::Optical,
            parameters: const {
                &[
                    EffectParameter::new("u1_percent", 0.5, 20.0),
                    EffectParameter::new("u2_percent", 0.5, 20.0),
                ]
            },
            about: "Displacements along the load and across it are reported too large by these percentages. Causes: gratings of another frequency, beams at another angle, pixels that are not square.",
            confirm: "Shift the specimen by a known amount along either direction and compare. Or measure the frequency of the gratings, or the sides of a pixel, on a calibrated target.",
        }
    }

    fn prior_sd_before_camera(&self, _k: usize, _scene: &Scene) -> Option<f64> {
        Some(BEFORE_CAMERA_PERCENT)
    }

    fn components(
        &self,
        amplitude: &[f64],
        _scene: &Scene,
        _reported: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        [0, 1].map(|k| u[k] * (1.0 + 0.01 * amplitude[k]))
    }
}
