//! The interpolation of grey values between pixels misreads the share of a displacement beyond whole pixels.

use std::f64::consts::TAU;

use super::optics::{displacements_are_imaged, in_data_axes};
use super::{Effect, EffectParameter, Entry, Kind, Scene, Scope};

pub struct InterpolationBias;

impl Effect for InterpolationBias {
    fn entry(&self) -> Entry {
        Entry {
            name: "interpolation_bias",
            kind: Kind::Optical,
            parameters: const { &[EffectParameter::new("amplitude_px", 0.01, 0.2)] },
            about: "The interpolation of grey values adds amplitude sin(2 pi u / pixel) to each component u of the displacement along the data's axes, rigid motion included. At whole and half pixels it adds nothing. Source: Schreier, Braasch and Sutton (2000), Optical Engineering 39.",
            confirm: "Move the unloaded specimen by tenths of a pixel and correlate: the error repeats with every pixel. Or correlate again with an interpolant of higher degree, or images that were blurred a little.",
        }
    }

    fn components(
        &self,
        amplitude: &[f64],
        scene: &Scene,
        _reported: [f64; 2],
        u: [f64; 2],
    ) -> [f64; 2] {
        let Some(wave) = self.exported(scene, u) else {
            return u;
        };
        [0, 1].map(|c| u[c] + amplitude[0] * wave[c])
    }

    fn exported(&self, scene: &Scene, exported: [f64; 2]) -> Option<[f64; 2]> {
        let pixel = scene.pixel_mm?;
        let wave = |u: [f64; 2]| u.map(|u| pixel * (TAU * u / pixel).sin());
        Some(in_data_axes(scene, exported, wave))
    }

    fn scope(&self) -> Scope {
        Scope::Recording
    }

    fn why_not(&self, scene: &Scene) -> Option<&'static str> {
        if !displacements_are_imaged(scene) {
            return Some("displacements are read from fringes, not from images");
        }
        scene
            .pixel_mm
            .is_none()
            .then_some("the size of a pixel is unknown: give image_correlation.pixel_mm")
    }
}
