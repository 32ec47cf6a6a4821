//! The hole's centre was set wrongly in the measured frame.

use super::optics::in_data_axes;
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct RegistrationOffset;

impl Effect for RegistrationOffset {
    fn entry(&self) -> Entry {
        Entry {
            name: "registration_offset",
            kind: Kind::Optical,
            parameters: const {
                &[
                    EffectParameter::new("dx_mm", 0.1, 2.0),
                    EffectParameter::new("dy_mm", 0.1, 2.0),
                ]
            },
            about: "The origin of the reported coordinates is not the hole's centre: reported = true + (dx, dy) along the data's x and y.",
            confirm: "Fit a circle to the hole's edge in the picture and compare its centre with the origin of the coordinates.",
        }
    }

    /// Displacements stay as they are, also those from image coordinates: a shift has no gradient.
    fn true_point(&self, amplitude: &[f64], scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        in_data_axes(scene, reported, |[x, y]| {
            [x - amplitude[0], y - amplitude[1]]
        })
    }
}
