//! The camera looks at the specimen at an angle.

use super::optics::in_data_axes;
use super::{Effect, EffectParameter, Entry, Kind, Scene};

pub struct CameraTilt;

impl Effect for CameraTilt {
    fn entry(&self) -> Entry {
        Entry {
            name: "camera_tilt",
            kind: Kind::Optical,
            parameters: const {
                &[
                    EffectParameter::new("x_per_mm", 1e-4, 2e-3),
                    EffectParameter::new("y_per_mm", 1e-4, 2e-3),
                ]
            },
            about: "The camera looks at an angle, so that the scale changes over the picture: true X = X (1 - (a x + b y)). a and b are along the data's x and y: the tangent of the tilt over the distance to the specimen. Displacements read from fringes stay right; those from image coordinates are distorted too.",
            confirm: "Picture a calibrated grid in the plane of the specimen: its parallel lines converge. Or square the camera by the reflection of its lens in a mirror on the specimen, and repeat.",
        }
    }

    fn true_point(&self, amplitude: &[f64], scene: &Scene, reported: [f64; 2]) -> [f64; 2] {
        in_data_axes(scene, reported, |[x, y]| {
            let scale = 1.0 - (amplitude[0] * x + amplitude[1] * y);
            [x * scale, y * scale]
        })
    }
}
