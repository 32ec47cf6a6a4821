//! The camera's axes are not the specimen's.

use super::optics::{displacements_are_imaged, in_data_axes};
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct CameraRotation;

impl Effect for CameraRotation {
    fn entry(&self) -> Entry {
        Entry {
            name: "camera_rotation",
            kind: Kind::Optical,
            parameters: const { &[EffectParameter::new("angle_deg", 0.5, 180.0)] },
            about: "The camera's axes are not the specimen's. Coordinates and components are turned about the hole's centre by the angle, counter-clockwise in the data's x-y plane. The camera itself is turned clockwise.",
            confirm: "Measure the angle of the specimen's straight edges against the pixel rows of the picture. Or turn the camera by a known angle and repeat: this angle changes by as much, a leaning load or a ply angle does not.",
        }
    }

    /// true X = R(-angle) reported X.
    fn true_point(&self, amplitude: &[f64], scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        in_data_axes(scene, reported, |x| turned(-amplitude[0], x))
    }

    /// reported U = R(angle) true U for fringes, whose grating is turned with the camera; image coordinates are turned by the map.
    fn components(
        &self,
        amplitude: &[f64],
        scene: &Scene,
        _reported: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        if displacements_are_imaged(scene) {
            return u;
        }
        in_data_axes(scene, u, |u| turned(amplitude[0], u))
    }
}

/// A vector (x, y) turned counter-clockwise.
fn turned(angle_deg: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}
