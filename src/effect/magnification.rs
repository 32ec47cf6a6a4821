//! The size of a pixel is not what it is taken for.

use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct Magnification;

/// reported / true coordinate.
fn scale(amplitude: &[f64]) -> f64 {
    1.0 + 0.01 * amplitude[0]
}

impl Effect for Magnification {
    fn entry(&self) -> Entry {
        Entry {
            name: "magnification",
            kind: Kind::Optical,
            parameters: const { &[EffectParameter::new("percent", 1.0, 20.0)] },
            about: "The pixel scale is wrong by s: reported X = (1 + s) true X about the hole's centre. Displacements read from fringes stay right; those from image coordinates are scaled too.",
            confirm: "Picture a calibrated target (a scale or a grid of dots) in the plane of the specimen. Or compare the specimen's width and the hole's diameter in the picture with those by calliper.",
        }
    }

    fn true_point(&self, amplitude: &[f64], _scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        reported.map(|x| x / scale(amplitude))
    }
}
