//! The specimen moves towards the camera.

use super::optics::no_camera;
use super::{Effect, EffectParameter, Entry, Kind, Scene, Scope};

pub struct OutOfPlaneTranslation;

/// Prior sd in a load series over the camera's distance (prototype study).
const OVER_DISTANCE: f64 = 1.5e-4;

impl Effect for OutOfPlaneTranslation {
    fn entry(&self) -> Entry {
        Entry {
            name: "out_of_plane_translation",
            kind: Kind::Optical,
            parameters: const { &[EffectParameter::new("w_mm", 0.075, 20.0)] },
            about: "The specimen moves towards the camera between the exposures, and its picture grows about the camera's axis by w over the camera's distance.",
            confirm: "A dial gauge on the face, or a second camera (3-D DIC), shows the motion; or repeat from twice the distance: its strain halves.",
        }
    }

    fn prior_sd_before_camera(&self, _k: usize, scene: &Scene) -> Option<f64> {
        scene.camera_distance_mm.map(|z| OVER_DISTANCE * z)
    }

    fn motion(&self, amplitude: &[f64], _scene: &Scene, _point: [f64; 2]) -> [f64; 3] {
        [0.0, 0.0, amplitude[0]]
    }

    fn scope(&self) -> Scope {
        Scope::Motion
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        no_camera(scene)
    }
}
