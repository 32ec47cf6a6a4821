//! A uniform strain that the load did not cause.

use super::{Effect, EffectParameter, Entry, Kind, Scene};

/// Strain in one microstrain.
const MICRO: f64 = 1e-6;

pub struct UniformStrain;

/// Prior sd of each component before a camera (prototype study).
const BEFORE_CAMERA_MICROSTRAIN: f64 = 30.0;

impl Effect for UniformStrain {
    fn entry(&self) -> Entry {
        Entry {
            name: "uniform_strain",
            kind: Kind::Additive,
            parameters: const {
                &[
                    EffectParameter::new("exx_microstrain", 10.0, 1e4),
                    EffectParameter::new("eyy_microstrain", 10.0, 1e4),
                    EffectParameter::new("exy_microstrain", 10.0, 1e4),
                ]
            },
            about: "A uniform strain along the data's x and y, which the load did not cause. Causes: motion towards the camera, a change of magnification during the test, or a carrier of fringes. exy is the tensor shear, half of gamma.",
            confirm: "Take two exposures at one and the same load: any strain between them is not from the load. Or repeat at half the load step: this strain does not halve. A second camera (3-D DIC) or a dial gauge on the face shows motion towards the camera; exposing the carrier alone shows that.",
        }
    }

    fn prior_sd_before_camera(&self, _k: usize, _scene: &Scene) -> Option<f64> {
        Some(BEFORE_CAMERA_MICROSTRAIN)
    }

    /// ux = exx x + exy y, uy = exy x + eyy y about the hole's centre: no rotation, and the hole's centre at rest.
    fn displacement(&self, amplitude: &[f64], scene: &Scene, point: [f64; 2]) -> [f64; 2] {
        let [x, y] = scene.frame.vector(point);
        let [exx, eyy, exy] = [0, 1, 2].map(|k| amplitude[k] * MICRO);
        scene.frame.vector([exx * x + exy * y, exy * x + eyy * y])
    }
}
