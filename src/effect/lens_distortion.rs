//! Radial distortion by the lens.

use super::optics::{displacements_are_imaged, imaged};
use super::{Effect, Entry, Kind, Parameter, Scene};

pub struct LensDistortion;

/// The radius at which the distortion is stated, mm.
const RADIUS_MM: f64 = 12.0;

/// k in true X = X (1 - k r^2), 1/mm^2.
fn coefficient(amplitude: &[f64]) -> f64 {
    0.01 * amplitude[0] / (RADIUS_MM * RADIUS_MM)
}

impl Effect for LensDistortion {
    fn entry(&self) -> Entry {
        Entry {
            name: "lens_distortion",
            kind: Kind::Optical,
            parameters: const { &[Parameter::new("percent_at_12mm", 0.3, 2.0)] },
            about: "Radial distortion about the hole's centre: true X = X (1 - k r^2), stated as k r^2 at a radius of 12 mm. Displacements read from fringes stay right; those from image coordinates are distorted too.",
            confirm: "Picture a calibrated grid of dots over the whole field of view; or move the specimen across the field of view and repeat: the distortion stays with the picture.",
        }
    }

    fn true_point(&self, amplitude: &[f64], _scene: &Scene, [s, t]: [f64; 2]) -> [f64; 2] {
        let scale = 1.0 - coefficient(amplitude) * (s * s + t * t);
        [s * scale, t * scale]
    }

    /// d true_i / d X_j = delta_ij (1 - k r^2) - 2 k X_i X_j.
    fn components(
        &self,
        amplitude: &[f64],
        scene: &Scene,
        [s, t]: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        if !displacements_are_imaged(scene) {
            return u;
        }
        let k = coefficient(amplitude);
        let scale = 1.0 - k * (s * s + t * t);
        let cross = -2.0 * k * s * t;
        imaged(
            [
                [scale - 2.0 * k * s * s, cross],
                [cross, scale - 2.0 * k * t * t],
            ],
            u,
        )
    }
}
